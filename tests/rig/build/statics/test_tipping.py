"""Rigs that tip over: figures by hand, feet that are built longer, and what is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from held_mounts import AROUND, four_cameras, held
from plans import tslot_plan
from rigs import compact_camera, face

from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts.clashes import find_clashes
from rig.build.mounts.plan import Give, Sag, Stance
from rig.build.mounts.planfile import plan_document, plan_from_mapping
from rig.build.mounts.solids import bar
from rig.build.mounts.structure import Joint, Member, PlacedPart, Plate, Structure
from rig.build.mounts.systemfile import system_from_mapping
from rig.build.mounts.systems.base import Spread
from rig.build.page.stiffness import stiffness
from rig.build.statics.steadying import settled_stances, steadied
from rig.build.statics.stiffening import Stiffened
from rig.build.statics.tipping import stances
from rig.build.statics.weights import Masses
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()
MASSES = Masses(CATALOGUE)
X, Y, Z = np.eye(3)
PER_M = float(CATALOGUE.profiles["2020"].mass_kg_per_m or 0.0)
HEAD_KG = float(CATALOGUE.find("generic-ball-25")[1].mass_g or 0.0) / 1e3
DATUM = np.array([0.0, 900.0, 1200.0])


def member(
    name: str, role: str, start: list[float], end: list[float], across: np.ndarray
) -> Member:
    return Member(name, "2020", role, np.array([start, end]), across, (20.0, 20.0))


def stand(front_mm: float = 300.0, aside_mm: float = 0.0) -> Structure:
    """Two feet of which ``front_mm`` are before a post, a rail on them, and a head on an arm."""
    feet = [
        member(f"{name} foot", "foot", [x, -200.0, 10.0], [x, front_mm, 10.0], X)
        for name, x in (("left", aside_mm + 250.0), ("right", aside_mm - 250.0))
    ]
    rail = member("rail", "rail", [aside_mm - 240.0, 0.0, 10.0], [aside_mm + 240.0, 0.0, 10.0], Y)
    post = member("post", "upright", [aside_mm, 0.0, 20.0], [aside_mm, 0.0, 1220.0], X)
    at = np.array([aside_mm, 400.0, 1220.0])
    place = np.eye(4)
    place[:3, 3] = at
    joints = [
        Joint("a", "left foot", "rail", rail.axis_mm[1]),
        Joint("b", "right foot", "rail", rail.axis_mm[0]),
        Joint("c", "rail", "post", post.axis_mm[0]),
        Joint("d", "post", "head", at),
    ]
    members = (*feet, rail, post)
    head = PlacedPart("head", "generic-ball-25", "head", place, joint="d")
    solids = tuple(bar(m.id, "member", *m.axis_mm, m.across, m.size_mm) for m in members)
    return Structure(members, (), (), (head,), tuple(joints), solids)


def by_hand(front_mm: float) -> float:
    """Push at 1200 mm that lifts the rear: weight times its lever about the front edge."""
    # Half the rail lies before y = 0, on the floor.
    edge = max(front_mm, 10.0)
    foot = PER_M * (front_mm + 200.0) / 1e3
    pieces = [  # mass, y
        (2.0 * foot, (front_mm - 200.0) / 2.0), (PER_M * 0.48, 0.0), (PER_M * 1.2, 0.0),
        (HEAD_KG, 400.0),
    ]  # fmt: skip
    return sum(mass * 9.81 * (edge - y) for mass, y in pieces) / 1200.0


@pytest.mark.parametrize("front_mm", [20.0, 100.0])
def test_what_tips_it_is_as_by_hand(front_mm: float) -> None:
    (found,) = stances(stand(front_mm), (), DATUM, MASSES)
    assert found.tips_n == pytest.approx(by_hand(front_mm), rel=1e-9)
    assert found.toward == "towards the subject" and found.on == ("left foot", "right foot")
    assert found.height_mm == pytest.approx(1200.0)
    assert found.push_n == 20.0 and not found.stands, "a fifth of 25 N would be too gentle"
    assert found.lacks_mm == pytest.approx(
        (20.0 - found.tips_n) * 1200.0 / found.mass_kg / 9.81, rel=1e-9
    )


def test_what_hangs_out_over_its_feet_falls_by_itself() -> None:
    (found,) = stances(stand(-150.0), (), DATUM, MASSES)
    assert found.tips_n == pytest.approx(by_hand(-150.0), rel=1e-9)
    assert found.tips_n < 0.0 and "by its own weight" in found.words


def test_what_is_not_joined_stands_by_itself() -> None:
    one, other = stand(200.0), stand(30.0, 2000.0)
    renamed = {
        name: tuple(replace(part, id=f"2 {part.id}") for part in getattr(other, name))
        for name in ("members", "parts", "joints")
    }
    joints = tuple(replace(j, on=f"2 {j.on}", other=f"2 {j.other}") for j in renamed["joints"])
    parts = tuple(replace(p, joint=f"2 {p.joint}") for p in renamed["parts"])
    both = Structure(
        one.members + renamed["members"], (), (), one.parts + parts, one.joints + joints,
        one.solids + tuple(replace(s, owner=f"2 {s.owner}") for s in other.solids),
    )  # fmt: skip
    found = stances(both, (), DATUM, MASSES)
    alone = [stances(each, (), DATUM, MASSES)[0].tips_n for each in (one, other)]
    assert [stance.tips_n for stance in found] == pytest.approx(alone)


@pytest.mark.parametrize("kind", ["t-slot", "arc"])
def test_a_mount_gets_feet_on_which_it_stands(kind: str) -> None:
    heavy, first = Masses(CATALOGUE, 2.0), held(kind)
    weak = [s for s in _stances(first, heavy) if not s.stands]
    mended = steadied(Stiffened(first.system, first), four_cameras(), AROUND, heavy)
    assert bool(weak) <= bool(mended.notes)
    assert all(stance.stands for stance in _stances(mended.first, heavy))
    if mended.notes:
        assert "Feet reach" in mended.notes[-1]
    built = mended.first.build()
    cameras = tuple(mount.camera for mount in built.mounts)
    assert find_clashes(built.structure.solids, built.joined, cameras, AROUND) == ()


def test_some_mount_needs_longer_feet() -> None:
    """What the test before mends is not nothing."""
    heavy = Masses(CATALOGUE, 2.0)
    assert any(not s.stands for kind in ("t-slot", "arc") for s in _stances(held(kind), heavy))


def _stances(holding: object, masses: Masses) -> tuple[Stance, ...]:
    built = holding.build()
    return stances(built.structure, built.mounts, AROUND.datum_mm, masses)


def test_a_plan_that_tips_says_what_would_hold_it() -> None:
    structure = stand(20.0)
    found, notes = settled_stances(structure, (), DATUM, MASSES)
    assert len(notes) == 1 and "screw left foot and right foot to the floor" in notes[0]
    plan = replace(tslot_plan(2), stances=found)
    assert replace(plan, stances=()).tipping == ()
    assert plan.tipping[0].words in notes[0]
    document = plan_document(plan)
    assert plan_document(plan_from_mapping(document)) == document
    older = {key: value for key, value in document.items() if key != "stances"}
    assert plan_from_mapping(older).stances == ()


def test_the_page_shows_what_tips() -> None:
    found, _ = settled_stances(stand(20.0), (), DATUM, MASSES)
    sag = Sag("c1", np.zeros(3), 0.1, 0.1, 0.1, (Give("tilt", "deg", 0.1, 0.5, 1.0),))
    page = stiffness(replace(tslot_plan(2), sags=(sag,), stances=found))
    assert f"<b>{found[0].tips_n:.0f}</b>" in page and "left foot, right foot" in page


def test_a_plate_of_unknown_material_is_told_and_not_taken_as_weightless() -> None:
    outline = np.array([[0.0, 0.0], [400.0, 0.0], [400.0, 300.0], [0.0, 300.0]])
    plate = Plate("board", "unobtainium", 8.0, np.eye(4), outline, ())
    joint = Joint("j9", "post", "board", np.zeros(3))
    made = stand()
    made = replace(made, plates=(plate,), joints=(*made.joints, joint))
    found, notes = settled_stances(made, (), DATUM, MASSES)
    assert found == ()
    assert "unobtainium" in notes[0] and "not known" in notes[0]


def around_it(*azimuths_deg: float) -> tuple[RigCamera, ...]:
    """Cameras about the face at 900 mm, at angles from the front to the subject's left."""
    middle, out = face().design_points.centroid_mm, []
    for k, azimuth in enumerate(np.radians(azimuths_deg)):
        way = np.array([np.sin(azimuth), -np.cos(azimuth), 0.1 * (k % 3 - 1)])
        pose = Pose.looking_at(middle + 900.0 * way, middle)
        out.append(RigCamera(f"c{k}", compact_camera(), pose, 900.0))
    return tuple(out)


@pytest.mark.parametrize(
    ("azimuths_deg", "profile", "corners"),
    [
        ((-35.0, -12.0, 12.0, 85.0), "2020", 1),
        ((-95.0, -80.0, 30.0), "4040", 1),
        ((-90.0, 0.0, 90.0, 180.0), "3030", 3),
    ],
)
def test_bays_that_would_tip_alone_are_tied_together(
    azimuths_deg: tuple[float, ...], profile: str, corners: int
) -> None:
    cameras = around_it(*azimuths_deg)
    spec = system_from_mapping({"kind": "t-slot", "profile": profile})
    first = spec.system.hold(cameras, AROUND)
    assert len(_stances(first, MASSES)) == corners + 1
    mended = steadied(Stiffened(first.system, first), cameras, AROUND, MASSES)
    (stance,) = _stances(mended.first, MASSES)
    assert stance.stands and "The bays are tied together" in mended.notes[-1]
    built = mended.first.build()
    placed = tuple(mount.camera for mount in built.mounts)
    assert find_clashes(built.structure.solids, built.joined, placed, AROUND) == ()
    ties = [member for member in built.structure.members if member.role == "tie"]
    brackets = [part for part in built.structure.parts if part.joint.startswith("tie")]
    assert (len(ties), len(brackets)) == (2 * corners, 6 * corners) and built.notes == ()
    low = [s.corners_mm[:, 2].min() for s in built.structure.solids if "tie" in s.owner]
    feet = [s.corners_mm[:, 2].min() for s in built.structure.solids if s.owner == "left foot 1"]
    assert min(low) == pytest.approx(feet[0], abs=1e-9) and feet[0] > AROUND.floor_z_mm
    # What is drilled and cut is told in whole millimetres: a tenth of a micrometre is rounding.
    cut = [tie.length_mm for tie in ties]
    assert cut == pytest.approx(np.round(cut), abs=1e-4)
    for joint in (j for j in built.structure.joints if j.id.startswith("tie")):
        on = next(m for m in built.structure.members if m.id == joint.on)
        away = np.linalg.norm(joint.point_mm - on.axis_mm[0])
        beside = on.size_mm[0] / 2.0
        assert away == pytest.approx(np.hypot(joint.along_mm or 0.0, beside), abs=1e-6)


def test_bays_across_from_each_other_are_not_tied() -> None:
    first = system_from_mapping({"kind": "t-slot"}).system.hold(around_it(85.0, -85.0), AROUND)
    built = first.with_spread(Spread(tied=True)).build()
    assert [m.id for m in built.structure.members] == [
        m.id for m in first.build().structure.members
    ]
