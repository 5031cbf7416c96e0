"""Building a mount so that it stands: bays tied together, feet that reach farther."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.build.mounts.clashes import find_clashes
from rig.build.mounts.plan import Stance
from rig.build.mounts.settings import CameraMount
from rig.build.mounts.structure import Structure, levelling_feet
from rig.build.mounts.surroundings import Surroundings
from rig.build.mounts.systems.base import Built, Holding, Spread
from rig.build.statics.stiffening import Stiffened
from rig.build.statics.tipping import stances
from rig.build.statics.weights import Masses

ROOM = 1.15
"""By how much more than the push a mount is made to withstand before its settings are final."""

STEP_MM, FARTHEST_MM, TRIES = 25.0, 800.0, 8
FACING = 0.5
"""Cosine from which an edge is before or behind the feet, not beside them."""


def steadied(
    stiff: Stiffened, cameras: tuple[RigCamera, ...], around: Surroundings, masses: Masses
) -> Stiffened:
    """The same mount with bays tied and feet that reach so far that nothing of it tips over.

    Ties come first: they keep feet short. As it was where it stands already, where neither
    suffices, or where they would be in the way.
    """
    plain = stiff.first.build()
    weak = _weak(plain, around, masses)
    if not weak:
        return stiff
    most = _in_the_way(plain, cameras, around)
    for tied in (True, False):
        start = stiff.first.with_spread(Spread(tied=tied))
        built = start.build()
        if tied and len(built.structure.members) == len(plain.structure.members):
            continue
        found = _on_its_feet(start, built, Spread(tied=tied), around, masses)
        if found is None or _in_the_way(found[1], cameras, around) > most:
            continue
        held = stiff.first.with_spread(found[0])
        without = replace(weak[0], push_n=weak[0].push_n / ROOM)
        words = f"{_how(found[0])}: without that {without.words}."
        return replace(stiff, system=held.system, first=held, notes=(*stiff.notes, words))
    return stiff


def _on_its_feet(
    first: Holding, built: Built, spread: Spread, around: Surroundings, masses: Masses
) -> tuple[Spread, Built] | None:
    """Feet that reach so far that nothing tips, beginning with ``spread``; None without any."""
    for _ in range(TRIES):
        weak = _weak(built, around, masses)
        if not weak:
            return spread, built
        spread = _wider(spread, weak, built.structure)
        if max(spread.front_mm, spread.rear_mm, spread.beside_mm) > FARTHEST_MM:
            return None
        built = first.with_spread(spread).build()
    return None if _weak(built, around, masses) else (spread, built)


def settled_stances(
    structure: Structure, mounts: tuple[CameraMount, ...], datum_mm: Floats, masses: Masses
) -> tuple[tuple[Stance, ...], tuple[str, ...]]:
    """The stances of a finished plan, and what is to be known of them."""
    try:
        found = stances(structure, mounts, datum_mm, masses)
    except InputError as error:
        return (), (f"Whether it tips over is not known: {error.problem}; {error.remedy}.",)
    tips = (f"It tips: {remedy(stance)}." for stance in found if not stance.stands)
    return found, (*tips, *_overloaded(structure, found, masses))


def _overloaded(structure: Structure, found: tuple[Stance, ...], masses: Masses) -> Iterator[str]:
    """What stands on levelling feet of which one does not carry it all.

    On uneven floor, or pushed, it stands on few of them; on one never with more than its weight.
    """
    for stance in found:
        parts = {part.part for member, _, part in levelling_feet(structure)
                 if member.id in stance.on}  # fmt: skip
        for part in sorted(parts):
            load = masses.catalogue.brackets[part].load_kg
            if load is not None and stance.mass_kg > load:
                yield (
                    f"{stance.mass_kg:.0f} kg stand on {' and '.join(stance.on)}, whose levelling "
                    f"feet {part} carry {load:g} kg each: use stronger ones, or set levelling_feet "
                    "= false."
                )


def remedy(stance: Stance) -> str:
    """What keeps something on its feet that would tip over."""
    return (
        f"{stance.words}; screw {' and '.join(stance.on)} to the floor, or have them reach "
        f"{STEP_MM * np.ceil(stance.lacks_mm / STEP_MM):.0f} mm farther {stance.toward}"
    )


def _weak(built: Built, around: Surroundings, masses: Masses) -> list[Stance]:
    """What would tip over, the weakest first."""
    try:
        found = stances(built.structure, built.mounts, around.datum_mm, masses)
    except InputError:
        return []
    weak = [replace(s, push_n=ROOM * s.push_n) for s in found if s.tips_n < ROOM * s.push_n]
    return sorted(weak, key=lambda stance: stance.tips_n)


def _wider(spread: Spread, weak: list[Stance], structure: Structure) -> Spread:
    """Feet that reach as far as what tips lacks, each the way that it tips."""
    members = {member.id: member for member in structure.members}
    more = {"front_mm": 0.0, "rear_mm": 0.0, "beside_mm": 0.0}
    for stance in weak:
        axes = [np.diff(members[foot].axis_mm, axis=0)[0, :2] for foot in stance.on]
        ways = [float(axis @ stance.way / np.linalg.norm(axis)) for axis in axes]
        side = "beside_mm"
        if max(ways) > FACING or min(ways) < -FACING:
            side = "front_mm" if max(ways) > -min(ways) else "rear_mm"
        lacks = max(STEP_MM, STEP_MM * float(np.ceil(stance.lacks_mm / STEP_MM)))
        more[side] = max(more[side], lacks)
    return replace(
        spread,
        front_mm=spread.front_mm + more["front_mm"],
        rear_mm=spread.rear_mm + more["rear_mm"],
        beside_mm=spread.beside_mm + more["beside_mm"],
    )


def _in_the_way(built: Built, cameras: tuple[RigCamera, ...], around: Surroundings) -> int:
    return len(find_clashes(built.structure.solids, built.joined, cameras, around))


def _how(spread: Spread) -> str:
    """What was done, as the beginning of a sentence."""
    reach = _reach(spread)
    if not spread.tied:
        return f"Feet reach {reach} farther"
    return "The bays are tied together" + (f" and feet reach {reach} farther" if reach else "")


def _reach(spread: Spread) -> str:
    parts = {"forward": spread.front_mm, "back": spread.rear_mm, "to each side": spread.beside_mm}
    return " and ".join(f"{size:.0f} mm {way}" for way, size in parts.items() if size > 0.0)
