"""Levelling feet: where they stand, what they hold, what is counted, set and told of them."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from held_mounts import AROUND, four_cameras, held
from plans import tslot_plan

from rig.build.mounts.shapes import ConvexShape, gap_mm
from rig.build.mounts.steps import assembly_steps
from rig.build.mounts.structure import LEVELLING, Structure, levelling_feet
from rig.build.mounts.systemfile import system_from_mapping
from rig.build.mounts.systems.base import Built
from rig.build.parts import bill_of_materials
from rig.build.parts.screws import taps
from rig.build.statics.framing import frame_of
from rig.build.statics.steadying import settled_stances
from rig.build.statics.tipping import stances
from rig.build.statics.weights import Masses
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()
MASSES = Masses(CATALOGUE)
KINDS = ("t-slot", "arc", "plate")


@cache
def built(kind: str) -> Built:
    return held(kind).build()


@cache
def without(kind: str) -> Built:
    spec = system_from_mapping({"kind": kind, "levelling_feet": False})
    return spec.system.hold(four_cameras(), AROUND).build()


def lowest(structure: Structure) -> dict[str, float]:
    return {s.owner: float(s.corners_mm[:, 2].min()) for s in structure.solids}


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_but_levelling_feet_stands_on_the_floor(kind: str) -> None:
    made = built(kind).structure
    pads = {p.id for p in made.parts if p.role == LEVELLING}
    low = {s.owner for s in made.solids if s.corners_mm[:, 2].min() < AROUND.floor_z_mm + 1.0}
    assert low == pads
    holders = Counter(member.id for member, _, _ in levelling_feet(made))
    assert holders == {
        m.id: 1 if m.role == "upright" else 2
        for m in made.members
        if m.role == "upright" or m.role.split()[-1] == "foot"
    }


@pytest.mark.parametrize("kind", KINDS)
def test_each_touches_the_member_that_stands_on_it(kind: str) -> None:
    made = built(kind).structure
    shapes = {m.id: ConvexShape(s.corners_mm) for m in made.members for s in made.solids
              if s.owner == m.id}  # fmt: skip
    for member, _, part in levelling_feet(made):
        gaps = [gap_mm(ConvexShape(s.corners_mm), shapes[member.id], 5.0)
                for s in made.solids if s.owner == part.id]  # fmt: skip
        assert len(gaps) == 2 and min(gaps) == pytest.approx(0.0, abs=1e-6), part.id
        span = CATALOGUE.brackets[part.part].height_mm
        base = lowest(made)[member.id] - AROUND.floor_z_mm
        assert span is not None and span[0] < base < span[1], "it can be turned both ways"


@pytest.mark.parametrize("kind", KINDS)
def test_the_bill_has_each_once_with_its_nut_or_its_tap(kind: str) -> None:
    plans = [replace(tslot_plan(2), structure=b.structure, mounts=b.mounts)
             for b in (built(kind), without(kind))]  # fmt: skip
    counts = [Counter({line.part: line.quantity for line in
                       bill_of_materials(plan, CATALOGUE).lines}) for plan in plans]  # fmt: skip
    feet = list(levelling_feet(built(kind).structure))
    uprights = sum(member.role == "upright" for member, _, _ in feet)
    more = counts[0] - counts[1]
    foot = "levelling-foot-2020"
    assert more[foot] == len(feet) and foot not in counts[1]
    assert more["t-nut-2020"] == len(feet) - uprights
    # Twice 5 mm deep and 4 mm for the tap; screws of pivots go deeper.
    tapped = [t for t in taps(built(kind).structure, CATALOGUE)
              if t.bores == 1 and t.depth_mm == 14.0]  # fmt: skip
    assert [t.member for t in tapped] == [m.id for m, j, _ in feet if not j.fasteners]
    assert len(tapped) == uprights


@pytest.mark.parametrize("kind", KINDS)
def test_it_stands_and_tips_on_the_middles_of_its_pads(kind: str) -> None:
    made = built(kind)
    frame = frame_of(made.structure, CATALOGUE)
    weight = frame.frame.weight(np.array([0.0, 0.0, -9.80665]))
    moves = frame.frame.moves(weight[:, :, None])[:, :, 0]
    # What stands keeps its place and turns; a node that became another's does neither.
    stands = (moves[:, :3] == 0.0).all(axis=1) & (moves[:, 3:] != 0.0).any(axis=1)
    on = frame.places_mm[stands, :2]
    pads = [p.rig_from_part[:2, 3] for m, _, p in levelling_feet(made.structure)
            if m.role != "upright"]  # fmt: skip
    assert sorted(map(tuple, np.round(on, 6))) == sorted(map(tuple, np.round(pads, 6)))
    found = stances(made.structure, made.mounts, AROUND.datum_mm, MASSES)
    wide = stances(without(kind).structure, without(kind).mounts, AROUND.datum_mm, MASSES)
    for one, other in zip(found, wide, strict=True):
        # The pads' middles lie inside of the members' corners: by half a pad and half a member
        # of 20 mm, hypot(12.5, 10) = 16.1 mm, at most.
        assert one.on == other.on and one.tips_n < other.tips_n
        assert one.height_mm == pytest.approx(AROUND.datum_mm[2] - AROUND.floor_z_mm)
        lever = other.tips_n * other.height_mm / other.mass_kg / 9.80665
        assert one.tips_n * one.height_mm / one.mass_kg / 9.80665 > lever - 16.1


def test_the_steps_say_how_they_are_set() -> None:
    text = " ".join(assembly_steps(built("t-slot").structure, built("t-slot").mounts, CATALOGUE))
    assert "Turn the pad of every levelling foot to 27 mm from the floor" in text
    assert "(22 to 32 mm can be set)" in text and "run those under U1, U2" in text
    assert text.count("join left foot 1 pad 1 to left foot 1, on its lower side") == 1
    plain = assembly_steps(without("t-slot").structure, without("t-slot").mounts, CATALOGUE)
    assert not any("levelling" in step for step in plain)


def test_feet_that_do_not_carry_the_frame_are_told() -> None:
    made = built("t-slot")
    _, notes = settled_stances(made.structure, made.mounts, AROUND.datum_mm, MASSES)
    assert not any("levelling" in note for note in notes)
    heavy = Masses(CATALOGUE, 20.0)
    _, notes = settled_stances(made.structure, made.mounts, AROUND.datum_mm, heavy)
    assert any("levelling-foot-2020 carry 80 kg each" in note for note in notes)


def test_a_profile_without_a_levelling_foot_stands_on_its_members() -> None:
    kept = {k: b for k, b in CATALOGUE.brackets.items() if b.kind != "levelling-foot"}
    spec = system_from_mapping({"kind": "t-slot"}, catalogue=replace(CATALOGUE, brackets=kept))
    made = spec.system.hold(four_cameras(), AROUND).build().structure
    assert not list(levelling_feet(made))
    assert min(lowest(made).values()) == pytest.approx(AROUND.floor_z_mm)
