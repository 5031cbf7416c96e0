"""Pivot joints: two halves on a pin, one on the face of a member, the other where it leads to."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats
from rig.build.mounts.kinematics import frame
from rig.build.mounts.solids import carried
from rig.build.mounts.structure import Joint, PlacedPart, Solid
from rig.catalogue.items import Bracket

SIDES = 12


def pivot_arm_mm(pivot: Bracket) -> float:
    """From the foot of a half to the pin: half of the height of the whole, both in line."""
    return (pivot.size_mm or (20.0, 40.0, 20.0))[1] / 2.0


def pivot_bolts(pivot: Bracket, screw: str, t_nut: str, *, end: bool = True) -> dict[str, int]:
    """What a pivot is screwed down with: as many screws as it takes, and nuts for those in a slot.

    ``end``: its second half lies on the end of a member, in whose core bore there is no nut.
    """
    count = pivot.bolts or 2
    return {screw: count, t_nut: count - count // 2 if end else count}


def pivot_part(
    joint: Joint,
    pivot: Bracket,
    pin_mm: Floats,
    pin: Floats,
    ways: tuple[Floats, Floats],
    camera: str = "",
) -> tuple[PlacedPart, tuple[Solid, Solid]]:
    """The pivot of a joint: its pin through ``pin_mm`` (3,) along ``pin`` (3,).

    ``ways``: unit vectors (3,) from the pin to the feet of its two halves, square to the pin.
    The part's frame lies on the pin, x along it, z against the first of the ways.
    """
    pin = pin / np.linalg.norm(pin)
    first = frame(pin_mm, pin, np.cross(-ways[0], pin), -ways[0])
    part = PlacedPart(f"{joint.id} pivot", pivot.id, "pivot", first, camera, joint.id)
    halves = [_half(part.id, pivot, pin_mm, pin, way) for way in ways]
    return part, (halves[0], halves[1])


def _half(owner: str, pivot: Bracket, pin_mm: Floats, pin: Floats, way: Floats) -> Solid:
    """A foot as wide as the profile, and an eye about the pin."""
    width, _, depth = pivot.size_mm or (20.0, 40.0, 20.0)
    arm, eye = pivot_arm_mm(pivot), min(depth, width) / 2.0
    at = frame(pin_mm, pin, np.cross(way, pin), way)
    foot = [[x, y, arm] for x in (-width / 2.0, width / 2.0) for y in (-depth / 2.0, depth / 2.0)]
    # Inscribed: the eye of one half must not reach over the foot of the other.
    turn = 2.0 * np.pi * np.arange(SIDES) / SIDES
    ring = [
        [x, eye * float(np.sin(t)), eye * float(np.cos(t))]
        for x in (-width / 2.0, width / 2.0)
        for t in turn
    ]
    return Solid(owner, "joint", carried(at, np.array([*foot, *ring])))
