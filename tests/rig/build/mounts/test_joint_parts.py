"""Brackets, pivots and strips in their places: drawn, counted, and in nobody's way."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from held_mounts import AROUND, four_cameras, held
from rigs import face, face_cameras, face_limits

from rig.build.mounts.clashes import find_clashes
from rig.build.mounts.making import figures
from rig.build.mounts.plan import MountPlan, Price
from rig.build.mounts.planfile import plan_document, plan_from_mapping
from rig.build.mounts.shapes import ConvexShape, Crowd, gap_mm
from rig.build.mounts.solids import bar
from rig.build.mounts.structure import LEVELLING, Joint, Member, Solid, Structure
from rig.build.mounts.systemfile import system_from_mapping
from rig.build.mounts.systems.base import Built
from rig.build.mounts.systems.corners import corner_places, corner_solid, with_corners
from rig.build.parts import bill_of_materials
from rig.build.parts.screws import taps
from rig.catalogue import load_catalogue
from solver.quality import evaluate

CATALOGUE = load_catalogue()
CORNER = CATALOGUE.brackets["corner-2020"]
KINDS = ("t-slot", "arc", "plate")
ROUNDING_MM = 0.05
"""Half of the tenth that drawings state; faces that touch are at 0."""


@cache
def built(kind: str) -> Built:
    return held(kind).with_stays().build()


def overlaps(structure: Structure) -> list[tuple[str, str, float]]:
    """Pairs of owners whose solids overlap, bolted together or not."""
    shapes = [ConvexShape(solid.corners_mm) for solid in structure.solids]
    owners, crowd = [solid.owner for solid in structure.solids], Crowd(shapes)
    found = [
        (owners[i], owners[k], gap_mm(shape, shapes[k], 1.0))
        for i, shape in enumerate(shapes)
        for k in crowd.near(shape, 0.0)
        if k > i and owners[i] != owners[k]
    ]
    return [pair for pair in found if pair[2] < -ROUNDING_MM]


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_overlaps_with_brackets_pivots_and_screws_in_their_places(kind: str) -> None:
    """94 brackets were counts only, and over the stub they hit the arm of six of seven cameras."""
    made = built(kind)
    assert overlaps(made.structure) == []
    cameras = tuple(mount.camera for mount in made.mounts)
    assert find_clashes(made.structure.solids, made.joined, cameras, AROUND) == ()


@pytest.mark.slow
@pytest.mark.parametrize("count", [5, 7, 9])
@pytest.mark.parametrize(
    ("kind", "profile"), [("t-slot", "3030"), ("arc", "4040"), ("arc", "2020")]
)
def test_nothing_overlaps_with_more_cameras(kind: str, profile: str, count: int) -> None:
    spec = system_from_mapping({"kind": kind, "profile": profile})
    made = spec.system.hold(face_cameras(face(), count), AROUND).with_stays().build()
    assert overlaps(made.structure) == []
    assert not any(CATALOGUE.brackets.keys() & joint.fasteners for joint in made.structure.joints)


@pytest.mark.parametrize("kind", KINDS)
def test_every_bracket_has_a_place_of_its_own(kind: str) -> None:
    made = built(kind).structure
    assert not any(CATALOGUE.brackets.keys() & joint.fasteners for joint in made.joints)
    solids = {s.owner for s in made.solids if s.kind == "joint"}
    parts = [p for p in made.parts if p.joint and p.part in CATALOGUE.brackets]
    assert {p.id for p in parts} == solids and len(parts) == len(solids) > 8
    joints = {joint.id: joint for joint in made.joints}
    for part in parts:
        if part.role == LEVELLING:
            assert sum(joints[part.joint].fasteners.values()) <= 1
            continue
        # Two screws, one in each of the members; so has a pivot, one in each of its halves. In a
        # slot there is a nut for each; a member that ends on a pivot has a bore for it.
        each = [p for p in parts if p.joint == part.joint]
        bolts = sum(CATALOGUE.brackets[p.part].bolts or 0 for p in each)
        fasteners = joints[part.joint].fasteners
        assert fasteners["cap-screw-m5"] == bolts
        tapped = [t for t in taps(made, CATALOGUE) if t.depth_mm == 16.0 and part.role == "pivot"]
        ends = {joints[part.joint].on, joints[part.joint].other} & {t.member for t in tapped}
        assert fasteners["t-nut-2020"] == bolts - len(ends), part.joint


@pytest.mark.parametrize("kind", KINDS)
def test_a_bracket_lies_on_both_of_its_members(kind: str) -> None:
    made = built(kind).structure
    shapes = {s.owner: ConvexShape(s.corners_mm) for s in made.solids if s.kind == "member"}
    joints = {joint.id: joint for joint in made.joints}
    corners = [p for p in made.parts if p.role == "corner bracket"]
    assert corners
    for part in corners:
        shape = ConvexShape(corner_solid(part.id, part.rig_from_part, CORNER).corners_mm)
        for end in (joints[part.joint].on, joints[part.joint].other):
            assert gap_mm(shape, shapes[end], 5.0) == pytest.approx(0.0, abs=0.5), part.id


def test_the_bill_counts_what_is_placed() -> None:
    for kind in KINDS:
        made = built(kind)
        now = figures(evaluate(face(), four_cameras(), face_limits()))
        plan = MountPlan("rig", kind, AROUND.datum_mm, made.structure, made.mounts,
                         Price(now, now, now), (), (), 1.0, 1)  # fmt: skip
        placed = Counter(p.part for p in made.structure.parts if p.joint)
        lines = {line.part: line.quantity for line in bill_of_materials(plan, CATALOGUE).lines}
        assert placed and all(lines[part] == count for part, count in placed.items())
        # A file of before says nothing of joints' parts, and is read.
        document = plan_document(plan)
        assert plan_from_mapping(document).structure.parts[-1].joint
        for part in document["structure"]["parts"]:
            del part["joint"]
        assert not plan_from_mapping(document).structure.parts[-1].joint


def member(name: str, start: list[float], end: list[float], across: int) -> Member:
    return Member(name, "2020", "bar", np.array([start, end]), np.eye(3)[across], (20.0, 20.0))


def crossing(*more: Solid) -> Structure:
    """A level bar before an upright, with two brackets asked for."""
    one = member("upright", [0.0, 0, 0], [0, 0, 400.0], 0)
    two = member("stub", [-100.0, 20, 200], [100.0, 20, 200], 1)
    joint = Joint("j", "upright", "stub", np.array([0.0, 0, 200]), 200.0, None,
                  {CORNER.id: 2, "x": 4})  # fmt: skip
    solids = [
        bar(m.id, "member", m.axis_mm[0], m.axis_mm[1], m.across, m.size_mm) for m in (one, two)
    ]
    return Structure((one, two), (), (), (), (joint,), (*solids, *more))


def test_two_bars_that_cross_have_four_corners_and_a_butt_joint_two() -> None:
    one, two = crossing().members
    found = corner_places(one, two, CORNER)
    assert {tuple(np.round(at[:3, 3])) for at in found} == {
        (0.0, 10.0, 210.0), (0.0, 10.0, 190.0), (10.0, 10.0, 200.0), (-10.0, 10.0, 200.0),
    }  # fmt: skip
    butt = member("rail", [0.0, 10, 200], [0.0, 300, 200], 0)
    found = corner_places(one, butt, CORNER)
    assert {tuple(np.round(at[:3, 3])) for at in found} == {(0.0, 10.0, 210.0), (0.0, 10.0, 190.0)}
    # Bars that only pass each other, or end in line, have none.
    far = replace(two, axis_mm=two.axis_mm + np.array([0.0, 30.0, 0.0]))
    assert corner_places(one, far, CORNER) == ()
    short = replace(two, axis_mm=np.array([[-10.0, 20, 200], [12.0, 20, 200]]))
    assert len(corner_places(one, short, CORNER)) == 2, "no room beside: above and below only"


@pytest.mark.parametrize("blocked", [(0.0, 30.0, 230.0), (0.0, 30.0, 170.0), (40.0, 0.0, 200.0)])
def test_a_bracket_goes_where_neither_it_nor_its_key_meets_anything(
    blocked: tuple[float, float, float],
) -> None:
    x, y, z = blocked
    low, high = np.array([x - 9.0, y - 9.0, z - 9.0]), np.array([x + 9.0, y + 9.0, z + 9.0])
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    structure, joined = with_corners(
        crossing(Solid("arm", "member", corners)), frozenset(), CORNER, (), AROUND
    )
    assert [p.joint for p in structure.parts] == ["j", "j"]
    assert CORNER.id not in structure.joints[0].fasteners
    for part in structure.parts:
        away = part.rig_from_part[:3, 3] - np.array([0.0, 10.0, 200.0])
        assert float(away @ (np.array(blocked) - [0.0, 10.0, 200.0])) <= 0.0
        assert frozenset((part.id, "stub")) in joined


def test_no_bracket_is_put_under_the_floor() -> None:
    one, two = crossing().members
    floor = replace(AROUND, floor_z_mm=190.0)
    structure, _ = with_corners(crossing(), frozenset(), CORNER, (), floor)
    assert one.id and two.id
    assert all(p.rig_from_part[2, 3] > 195.0 for p in structure.parts)
