"""The bill of a frame worked through from its solids: each part once, each screw where it holds."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
from held_mounts import held
from plans import tslot_plan

from rig.build.mounts.shapes import ConvexShape, gap_mm
from rig.build.mounts.structure import Member, Solid
from rig.build.parts import bill_of_materials
from rig.build.parts.screws import taps
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()
TOUCH_MM = 0.6
"""A stay is cut to a whole millimetre: half of what is missing lies at each of its ends."""


def touched(solid: Solid, members: dict[str, tuple[Member, ConvexShape]]) -> list[str]:
    """How a solid lies on members: ``slot`` or ``end`` for each."""
    shape = ConvexShape(solid.corners_mm)
    found = []
    for member, body in members.values():
        if gap_mm(shape, body, 1.0) > TOUCH_MM:
            continue
        along = (member.axis_mm[1] - member.axis_mm[0]) / member.length_mm
        places = (solid.corners_mm - member.axis_mm[0]) @ along
        beyond = places.min() > member.length_mm - TOUCH_MM or places.max() < TOUCH_MM
        found.append("end" if beyond else "slot")
    return found


def test_screws_nuts_and_taps_are_those_of_the_places_where_parts_lie() -> None:
    built = held("t-slot").with_stays().build()
    made = built.structure
    bodies = {s.owner: ConvexShape(s.corners_mm) for s in made.solids if s.kind == "member"}
    members = {m.id: (m, bodies[m.id]) for m in made.members}
    role = {part.id: part.role for part in made.parts}
    lies: Counter[tuple[str, str]] = Counter()
    for solid in made.solids:
        if solid.kind == "joint":
            lies.update((role[solid.owner], how) for how in touched(solid, members))
    corners, pivots = (
        sum(r == name for r in role.values()) for name in ("corner bracket", "pivot")
    )
    plates = sum(name == "head plate" for name in role.values())
    feet, uprights = (sum(m.role.split()[-1] == name for m in made.members)
                      for name in ("foot", "upright"))  # fmt: skip
    assert lies == {
        ("corner bracket", "slot"): 2 * corners, ("pivot", "slot"): pivots,
        ("pivot", "end"): pivots, ("levelling foot", "slot"): 2 * feet,
        ("levelling foot", "end"): uprights,
    }  # fmt: skip
    plan = replace(tslot_plan(2), structure=made, mounts=built.mounts)
    count = {line.name: line.quantity for line in bill_of_materials(plan, CATALOGUE).lines}
    screw = "Hexagon socket head cap screw M5 × {} mm"
    assert count[screw.format(8)] == 2 * corners + pivots
    assert count[screw.format(16)] == pivots and count[screw.format(10)] == 2 * plates
    assert count["T-nut for 2020, M5"] == 2 * corners + pivots + 2 * plates + 2 * feet
    assert sum(tap.bores for tap in taps(made, CATALOGUE)) == pivots + uprights
    assert count["Profile 20 x 20, slot 5"] == len(bodies)
    lengths = [np.ptp(s.corners_mm @ (m.axis_mm[1] - m.axis_mm[0]) / m.length_mm)
               for s in made.solids for m in made.members if s.owner == m.id]  # fmt: skip
    profile = next(line for line in bill_of_materials(plan, CATALOGUE).lines if line.length_mm)
    assert np.isclose(sum(lengths), profile.length_mm or 0.0)
