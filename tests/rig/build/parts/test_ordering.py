"""What a shop is asked for: screws by length, bores to tap, caps, and bars that are sawn."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from held_mounts import AROUND, four_cameras, held
from plans import tslot_plan
from rigs import face, face_limits

from common.errors import InputError
from rig.build.mounts.making import figures
from rig.build.mounts.plan import MountPlan, Price
from rig.build.mounts.shapes import ConvexShape, gap_mm
from rig.build.mounts.solids import bar
from rig.build.mounts.structure import Member
from rig.build.parts import Stock, bill_of_materials, stock_bars
from rig.build.parts.screws import end_caps, screw_mm, taps
from rig.catalogue import load_catalogue
from solver.quality import evaluate

CATALOGUE = load_catalogue()


@cache
def plan(kind: str) -> MountPlan:
    built = held(kind).build()
    now = figures(evaluate(face(), four_cameras(), face_limits()))
    return MountPlan(
        "rig", kind, AROUND.datum_mm, built.structure, built.mounts, Price(now, now, now), (), (),
        1.0, 1,
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["t-slot", "plate", "arc"])
def test_every_screw_has_a_length(kind: str) -> None:
    """The bill listed 136 screws without one."""
    joints = [j for j in plan(kind).structure.joints if any("screw" in p for p in j.fasteners)]
    assert len(joints) > 5
    for joint in joints:
        assert screw_mm(joint, plan(kind).structure, CATALOGUE) is not None, joint.id
    names = [line.name for line in bill_of_materials(plan(kind), CATALOGUE).lines
             if line.part.startswith("cap-screw")]  # fmt: skip
    assert names and all(name.endswith(" mm") for name in names)


def test_lengths_follow_from_what_a_screw_goes_through() -> None:
    structure = plan("plate").structure
    lengths = {j.id: screw_mm(j, structure, CATALOGUE) for j in structure.joints}
    name = plan("plate").mounts[0].name
    # 10 mm of plate and twice 5 mm in the bore; 6 mm of wedge and 4 mm in a nut; 4 and 4 mm.
    assert lengths[f"{name} a"] == 20.0
    assert lengths[f"{name} b"] == 10.0
    assert lengths["left foot a"] == 8.0
    # 10 mm of plate and 4 mm in a nut: the next length is 16.
    assert lengths["left upright b"] == 16.0


def test_posts_are_tapped_as_deep_as_their_screws_reach() -> None:
    found = taps(plan("plate").structure, CATALOGUE)
    posts = [f"{m.name} post" for m in plan("plate").mounts]
    assert [t.member for t in found] == [*posts, "left upright", "right upright"]
    # A screw of 20 mm through 10 mm of plate, and 4 mm for the tap; a stud twice its 5 mm deep.
    assert {(t.bores, t.thread, t.depth_mm) for t in found[:-2]} == {(2, "M5", 14.0)}
    assert {(t.bores, t.thread, t.depth_mm) for t in found[-2:]} == {(1, "M5", 14.0)}
    uprights = [m.id for m in plan("t-slot").structure.members if m.role == "upright"]
    assert [t.member for t in taps(plan("t-slot").structure, CATALOGUE)] == uprights


@pytest.mark.parametrize("kind", ["plate", "t-slot", "arc"])
def test_open_ends_are_capped_where_a_cap_has_room(kind: str) -> None:
    """Caps were counted for rails that end against their feet, and stays on their pivots."""
    made = held(kind).with_stays().build().structure
    shapes = [(s.owner, ConvexShape(s.corners_mm)) for s in made.solids]
    counted = 0
    for member in made.members:
        along = (member.axis_mm[1] - member.axis_mm[0]) / member.length_mm
        for end, way, mitre in zip(member.axis_mm, (-along, along), member.mitres_deg, strict=True):
            cap = bar("cap", "cap", end, end + 2.0 * way, member.across, member.size_mm)
            shape = ConvexShape(cap.corners_mm)
            free = all(gap_mm(shape, other, 0.1) > -0.1 for _, other in shapes)
            # The stud of a levelling foot comes out of the end that it is in.
            counted += free and mitre == 0.0
    assert counted > 5 and list(end_caps(made, CATALOGUE).values()) == [counted]


def cut(*lengths: float) -> MountPlan:
    members = tuple(
        Member(f"m{k}", "2020", "bar", np.array([[0.0, 0, 0], [0, 0, length]]), np.eye(3)[0],
               (20.0, 20.0))
        for k, length in enumerate(lengths)
    )  # fmt: skip
    base = tslot_plan(2)
    return replace(base, structure=replace(base.structure, members=members))


def test_pieces_are_sawn_from_bars_with_their_kerf() -> None:
    bars = stock_bars(cut(1000.0, 1997.0, 990.0, 500.0), Stock(3000.0, 3.0))
    # 1997 + 1000 and two cuts are 3003: they do not fit, 1997 + 990 do.
    assert [[name for name, _ in bar.pieces] for bar in bars] == [["m1", "m2"], ["m0", "m3"]]
    assert bars[0].rest_mm == pytest.approx(3000.0 - 1997.0 - 990.0 - 6.0)
    assert bars[1].rest_mm == pytest.approx(3000.0 - 1500.0 - 6.0)
    both = stock_bars(cut(1000.0, 1997.0), Stock(3000.0, 1.5))
    assert len(both) == 1 and both[0].rest_mm == pytest.approx(0.0)


def test_a_piece_longer_than_a_bar_gets_its_own() -> None:
    bar, other = stock_bars(cut(3200.0, 900.0), Stock(1000.0, 3.0))
    assert (bar.length_mm, bar.pieces) == (4000.0, (("m0", 3200.0),))
    assert (other.length_mm, other.pieces) == (1000.0, (("m1", 900.0),))


def test_every_member_of_a_plan_is_on_one_bar() -> None:
    for kind in ("t-slot", "arc"):
        bars = stock_bars(plan(kind), Stock())
        names = sorted(name for bar in bars for name, _ in bar.pieces)
        assert names == sorted(m.id for m in plan(kind).structure.members)
        assert all(bar.rest_mm >= 0.0 for bar in bars)


def test_a_kerf_wider_than_a_bar_is_refused() -> None:
    with pytest.raises(InputError, match="cannot be sawn"):
        Stock(3.0, 3.0)
