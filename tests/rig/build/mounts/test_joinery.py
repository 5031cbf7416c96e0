"""Members that meet without running into each other, and marks that mean one thing."""

from __future__ import annotations

import re
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from held_mounts import held

from rig.build.mounts.rounding import nearest
from rig.build.mounts.shapes import ConvexShape, gap_mm
from rig.build.mounts.steps import assembly_steps
from rig.build.mounts.structure import Member
from rig.build.mounts.systems.base import Built
from rig.build.statics.framing import nearest_along
from rig.catalogue import load_catalogue

KINDS = ("t-slot", "arc", "plate")
CATALOGUE = load_catalogue()


@cache
def built(kind: str) -> Built:
    return held(kind).with_stays().build()


@pytest.mark.parametrize("kind", KINDS)
def test_no_member_runs_into_another_bolted_or_not(kind: str) -> None:
    """Pairs that are bolted together are no clash: 33 pairs of an arc overlapped unseen."""
    solids = [s for s in built(kind).structure.solids if s.kind in ("member", "plate")]
    shapes = [ConvexShape(solid.corners_mm) for solid in solids]
    pairs = [
        (solids[i].owner, solids[k].owner)
        for i, k in combinations(range(len(solids)), 2)
        # 0.05 mm: half of what is stated; surfaces that touch are at 0.
        if solids[i].owner != solids[k].owner and gap_mm(shapes[i], shapes[k], 1.0) < -0.05
    ]
    assert pairs == []


@pytest.mark.parametrize("kind", KINDS)
def test_marks_count_from_the_start_of_a_member_to_the_middle_of_a_joint(kind: str) -> None:
    """Marks mixed edges and middles, ten millimetres apart."""
    members = {m.id: m for m in built(kind).structure.members}
    marked = [j for j in built(kind).structure.joints if j.along_mm is not None]
    assert len(marked) > 5
    for joint in marked:
        middle = nearest_along(members[joint.on], joint.point_mm)
        # Half a millimetre: the stays' whole millimetres leave half of the rest at each end.
        assert joint.along_mm == pytest.approx(middle, abs=0.5), joint.id


def test_the_start_of_a_member_is_named_by_where_it_lies() -> None:
    ends = {
        (0.0, 1.0, 3.0): "lower end",
        (0.0, 1.0, -3.0): "upper end",
        (1.0, 2.0, 0.0): "rear end",
        (1.0, -2.0, 0.0): "front end",
        (2.0, 1.0, 0.0): "end on the subject's right",
        (-2.0, 1.0, 0.0): "end on the subject's left",
    }
    for way, words in ends.items():
        axis = np.array([[0.0, 0.0, 0.0], way])
        assert Member("m", "2020", "bar", axis, np.eye(3)[0], (20.0, 20.0)).start == words
    text = " ".join(assembly_steps(built("t-slot").structure, built("t-slot").mounts, CATALOGUE))
    assert "mm from its lower end" in text and "from its start" not in text
    assert re.search(r"\d x cap-screw-m5, \d+ mm long", text)
    assert not re.search(r"\d x cap-screw-m5(?!, \d+ mm long)", text), "no screw without its length"


def test_facets_are_mitred_where_they_meet_and_square_at_the_ends_of_their_rib() -> None:
    facets = [m for m in built("arc").structure.members if m.role == "facet"]
    first, second = facets[0], facets[1]
    assert first.mitres_deg[0] == 0.0 and first.mitres_deg[1] == second.mitres_deg[0] > 5.0
    bend = np.degrees(np.arccos(
        (first.axis_mm[1] - first.axis_mm[0]) @ (second.axis_mm[1] - second.axis_mm[0])
        / first.length_mm / second.length_mm
    ))  # fmt: skip
    assert 2.0 * first.mitres_deg[1] == pytest.approx(bend)
    # Half the depth times the slope of the cut, at one end.
    more = first.size_mm[1] / 2.0 * np.tan(np.radians(first.mitres_deg[1]))
    assert first.long_side_mm == pytest.approx(first.length_mm + more)
    text = " ".join(assembly_steps(built("arc").structure, built("arc").mounts, CATALOGUE))
    assert f"saw turned by 0.0 degrees at its {first.start} and {first.mitres_deg[1]:.1f}" in text


@pytest.mark.parametrize("kind", ["t-slot", "arc"])
def test_an_arm_can_be_set_less_far_as_its_weight_asks_and_further(kind: str) -> None:
    """Arms ended flush with their upright: of a frame that leans forward, they are to be set less.

    By 3 mm on this arc.
    """
    holding = held(kind)
    made = holding.with_mounts(tuple(nearest(mount) for mount in holding.mounts)).build()
    members = {m.id: m for m in made.structure.members}
    solids = {s.owner: s.corners_mm for s in made.structure.solids if s.kind == "member"}
    for mount in made.mounts:
        step = next(s.step for s in mount.settings if s.name == "reach")
        arm, stub = members[f"{mount.name} arm"], members[f"{mount.name} stub"]
        along = (arm.axis_mm[1] - arm.axis_mm[0]) / arm.length_mm
        rail = next(i for i in mount.carried_by if i in members and members[i].role in
                    ("upright", "facet") and i in ends_of(made, stub.id))  # fmt: skip
        for steps in (-4.0, -3.0, -1.0, 1.0):
            moved = ConvexShape(solids[arm.id] + steps * step * along)
            assert gap_mm(moved, ConvexShape(solids[rail]), 1.0) > -1e-6, arm.id
            # The nuts of its brackets, 10 mm long, are on the middle line of the stub.
            behind = (stub.axis_mm[0] - arm.axis_mm[0] - steps * step * along) @ along
            assert behind >= 5.0 - 1e-9, arm.id


def ends_of(made: Built, stub: str) -> set[str]:
    """What a stub is screwed to."""
    return {joint.on for joint in made.structure.joints if joint.other == stub}
