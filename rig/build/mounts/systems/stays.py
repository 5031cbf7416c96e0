"""Back-stays: what keeps uprights from leaning under the cameras that hang before them.

A sill lies across the rear of the feet, and from it a stay leans against the rear of each upright.
Both ends of a stay are on pivot joints, so that it may stand at any slope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from rig.build.mounts.structure import Joint, Member, PlacedPart, Solid
from rig.build.mounts.systems.corners import leg_mm
from rig.build.mounts.systems.pivots import pivot_arm_mm, pivot_bolts, pivot_part
from rig.catalogue.items import Bracket, Profile

Z = np.array([0.0, 0.0, 1.0])
STAY_SHARE = 0.75
"""Where a stay meets its upright, as a share of its height: what stands over it is short."""

BESIDE_MM = 5.0
OVERHANG_MM = 40.0


@dataclass(frozen=True)
class StayParts:
    """What sill and stays are made of."""

    profile: Profile
    corner: Bracket
    pivot: Bracket
    screw: str
    t_nut: str

    @property
    def rear_mm(self) -> float:
        """From the rear ends of the feet to the middle of the sill: a bracket goes behind it."""
        return self.profile.width_mm / 2.0 + leg_mm(self.corner)[0] + BESIDE_MM

    @property
    def corners(self) -> dict[str, int]:
        """What a square joint takes."""
        return {self.corner.id: 2, self.screw: 4, self.t_nut: 4}

    @property
    def pivots(self) -> dict[str, int]:
        """What a joint at a slope takes."""
        return pivot_bolts(self.pivot, self.screw, self.t_nut)


@dataclass(frozen=True, eq=False)
class Stays:
    """What back-stays add to a mount. ``solids`` are those of ``parts``, their pivots."""

    members: tuple[Member, ...] = ()
    joints: tuple[Joint, ...] = ()
    parts: tuple[PlacedPart, ...] = ()
    solids: tuple[Solid, ...] = ()

    def touching(self) -> list[tuple[str, str]]:
        """Pairs of owners that touch by intent."""
        pairs = {joint.id: (joint.on, joint.other) for joint in self.joints}
        return [(part.id, end) for part in self.parts for end in pairs[part.joint]]

    def __add__(self, other: Stays) -> Stays:
        return Stays(
            self.members + other.members, self.joints + other.joints, self.parts + other.parts,
            self.solids + other.solids,
        )  # fmt: skip


def stayed(
    name: str,
    uprights: Sequence[Member],
    feet: Sequence[Member],
    parts: StayParts,
) -> Stays:
    """The sill ``sill NAME`` on parallel feet and a stay for each upright, with their joints.

    Feet begin at their rear. Between two feet the sill lies on the floor as they do; on one it
    lies across.
    """
    part, first = parts.profile, feet[0]
    forward = first.axis_mm[1] - first.axis_mm[0]
    forward = forward / np.linalg.norm(forward)
    size = (part.width_mm, part.height_mm)
    axis = _sill_axis(feet, uprights, forward, parts)
    sill = Member(f"sill {name}", part.id, "sill", axis, forward, size)
    joints: list[Joint] = []
    for k, foot in enumerate(feet):
        at = axis[k] if len(feet) > 1 else foot.axis_mm[0] + parts.rear_mm * forward
        joints.append(Joint(f"{sill.id} {'ab'[k]}", foot.id, sill.id, at, parts.rear_mm, None,
                            parts.corners))  # fmt: skip
    made = Stays((sill,), tuple(joints))
    for upright in uprights:
        made += _one(upright, sill, forward, parts)
    return made


def _one(upright: Member, sill: Member, forward: Floats, parts: StayParts) -> Stays:
    """One stay, its two joints and their pivots."""
    first, last = sill.axis_mm
    across = (last - first) / np.linalg.norm(last - first)
    stay, slope, (low, high) = _stay(upright, sill.axis_mm, forward, across, parts)
    up = float((high - upright.axis_mm[0]) @ Z)
    beside = float((low - first) @ across)
    joints = (
        Joint(f"{stay.id} a", sill.id, stay.id, low, beside, slope, parts.pivots),
        Joint(f"{stay.id} b", upright.id, stay.id, high, up, 90.0 - slope, parts.pivots),
    )
    way = (high - low) / np.linalg.norm(high - low)
    made = (
        pivot_part(joints[0], parts.pivot, low, across, (-Z, way)),
        pivot_part(joints[1], parts.pivot, high, across, (forward, -way)),
    )
    solids = tuple(solid for _, halves in made for solid in halves)
    return Stays((stay,), joints, tuple(part for part, _ in made), solids)


def _sill_axis(
    feet: Sequence[Member], uprights: Sequence[Member], forward: Floats, parts: StayParts
) -> Floats:
    ends = np.stack([foot.axis_mm[0] + parts.rear_mm * forward for foot in feet])
    if len(feet) > 1:
        inward = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        half = feet[0].size_mm[0] / 2.0
        return np.stack([ends[0] + half * inward, ends[1] - half * inward])
    across = np.cross(forward, Z)
    lift = (feet[0].size_mm[1] + parts.profile.height_mm) / 2.0 * Z
    beside = float((uprights[0].axis_mm[0] - ends[0]) @ across)
    reach = np.array([min(0.0, beside) - OVERHANG_MM, max(0.0, beside) + OVERHANG_MM])
    return np.asarray(ends[0] + lift + reach[:, None] * across)


def _stay(
    upright: Member, sill: Floats, forward: Floats, across: Floats, parts: StayParts
) -> tuple[Member, float, tuple[Floats, Floats]]:
    """The stay of an upright, its slope over the level in degrees, and the pins at its ends."""
    part, arm = parts.profile, pivot_arm_mm(parts.pivot)
    foot, height = upright.axis_mm[0], upright.length_mm
    beside = float((foot - sill[0]) @ across)
    low = sill[0] + beside * across + (part.height_mm / 2.0 + arm) * Z
    high = foot + np.round(STAY_SHARE * height) * Z - (upright.size_mm[1] / 2.0 + arm) * forward
    run = high - low
    length = float(np.floor(np.linalg.norm(run) - 2.0 * arm))
    # Cut to a whole millimetre; what is missing is in the pivots, half at each end.
    middle, along = (low + high) / 2.0, run / np.linalg.norm(run)
    axis = np.stack([middle - length / 2.0 * along, middle + length / 2.0 * along])
    slope = float(np.degrees(np.arctan2(run @ Z, run @ forward)))
    size = (part.width_mm, part.height_mm)
    return Member(f"{upright.id} stay", part.id, "stay", axis, across, size), slope, (low, high)
