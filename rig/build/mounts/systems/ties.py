"""Ties: two bars on the floor that make one body of two bays that stand square to each other.

The first goes straight out from a foot of the one bay, the second from it to the nearest foot of
the other; every joint is square and takes two corner brackets.
"""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats
from rig.build.mounts.structure import Joint, Member
from rig.build.mounts.systems.corners import leg_mm
from rig.build.mounts.systems.stays import BESIDE_MM, StayParts, Stays

TIE = "tie"
SQUARE = 1e-6
"""Cosine up to which two feet count as square to each other."""


def tied(name: str, one: Member, other: Member, parts: StayParts) -> Stays:
    """Ties ``tie NAME a`` and ``tie NAME b`` from one foot to another, with their joints.

    Feet begin at their rear. Empty where the feet are not square to each other, or so near that
    brackets have no room.
    """
    origin, deep = one.axis_mm[0], _unit(one.axis_mm[1] - one.axis_mm[0])
    aside = one.across * np.sign(one.across @ (other.axis_mm[0] - origin))
    if abs(deep @ _unit(other.axis_mm[1] - other.axis_mm[0])) > SQUARE:
        return Stays()
    width, leg = parts.profile.width_mm, leg_mm(parts.corner)[0]
    room = width / 2.0 + leg + BESIDE_MM
    # Where the other foot lies, as seen from the rear of the first one: aside and deep.
    ends = np.sort([float(aside @ (end - origin)) for end in other.axis_mm])
    away = float(deep @ (other.axis_mm[0] - origin))
    most = min(one.length_mm - room, away - width - 2.0 * leg - BESIDE_MM)
    long_b = float(np.ceil(away - width - most))
    along = away - width - long_b
    out = float(np.ceil(max(ends[0] + room, 2.0 * room)))
    if along < room or out > ends[1] - room:
        return Stays()

    def place(across_mm: float, deep_mm: float) -> Floats:
        return np.asarray(origin + across_mm * aside + deep_mm * deep)

    first = np.stack([place(width / 2.0, along), place(np.ceil(out + room), along)])
    second = np.stack([place(out, along + width / 2.0), place(out, away - width / 2.0)])
    size = (width, parts.profile.height_mm)
    a, b = (
        Member(f"{TIE} {name} {end}", parts.profile.id, TIE, axis, across, size)
        for end, axis, across in (("a", first, deep), ("b", second, aside))
    )
    start = float(aside @ (other.axis_mm[0] - origin))
    joints = (
        Joint(f"{a.id} foot", one.id, a.id, first[0], along, None, parts.corners),
        Joint(f"{a.id} {b.id}", a.id, b.id, second[0], out - width / 2.0, None, parts.corners),
        Joint(f"{b.id} foot", other.id, b.id, second[1], abs(start - out), None, parts.corners),
    )
    return Stays((a, b), joints)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))
