"""Back-stays: what keeps uprights from leaning under the cameras that hang before them.

A sill lies across the rear of the feet, and from it a stay leans against the rear of each upright.
Both ends of a stay are on pivot joints, so that it may stand at any slope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from rig.build.mounts.structure import Joint, Member
from rig.catalogue.items import Bracket, Profile

Z = np.array([0.0, 0.0, 1.0])
STAY_SHARE = 0.75
"""Where a stay meets its upright, as a share of its height: what stands over it is short."""

REAR_MM = 30.0
"""From the rear ends of the feet to the middle of the sill."""

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
    def corners(self) -> dict[str, int]:
        """What a square joint takes."""
        return {self.corner.id: 2, self.screw: 4, self.t_nut: 4}

    @property
    def pivots(self) -> dict[str, int]:
        """What a joint at a slope takes."""
        return {self.pivot.id: 1, self.screw: 2, self.t_nut: 2}


def stayed(
    name: str,
    uprights: Sequence[Member],
    feet: Sequence[Member],
    parts: StayParts,
) -> tuple[list[Member], list[Joint]]:
    """The sill ``sill NAME`` on parallel feet and a stay for each upright, with their joints.

    Feet begin at their rear. Between two feet the sill lies on the floor as they do; on one it
    lies across.
    """
    part, first = parts.profile, feet[0]
    forward = first.axis_mm[1] - first.axis_mm[0]
    forward = forward / np.linalg.norm(forward)
    size = (part.width_mm, part.height_mm)
    axis = _sill_axis(feet, uprights, forward, part)
    sill = Member(f"sill {name}", part.id, "sill", axis, forward, size)
    across = (axis[1] - axis[0]) / np.linalg.norm(axis[1] - axis[0])
    members, joints = [sill], []
    for k, foot in enumerate(feet):
        at = axis[k] if len(feet) > 1 else foot.axis_mm[0] + REAR_MM * forward
        joints.append(Joint(f"{sill.id} {'ab'[k]}", foot.id, sill.id, at, REAR_MM, None,
                            parts.corners))  # fmt: skip
    for upright in uprights:
        stay, slope = _stay(upright, axis, forward, across, parts)
        low, high = stay.axis_mm
        up = upright.axis_mm[0] + float((high - upright.axis_mm[0]) @ Z) * Z
        members.append(stay)
        joints += [
            Joint(f"{stay.id} a", sill.id, stay.id, low, float((low - axis[0]) @ across), slope,
                  parts.pivots),
            Joint(f"{stay.id} b", upright.id, stay.id, high, float((up - upright.axis_mm[0]) @ Z),
                  90.0 - slope, parts.pivots),
        ]  # fmt: skip
    return members, joints


def _sill_axis(
    feet: Sequence[Member], uprights: Sequence[Member], forward: Floats, part: Profile
) -> Floats:
    ends = np.stack([foot.axis_mm[0] + REAR_MM * forward for foot in feet])
    if len(feet) > 1:
        inward = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        half = feet[0].size_mm[0] / 2.0
        return np.stack([ends[0] + half * inward, ends[1] - half * inward])
    across = np.cross(forward, Z)
    lift = (feet[0].size_mm[1] + part.height_mm) / 2.0 * Z
    beside = float((uprights[0].axis_mm[0] - ends[0]) @ across)
    reach = np.array([min(0.0, beside) - OVERHANG_MM, max(0.0, beside) + OVERHANG_MM])
    return np.asarray(ends[0] + lift + reach[:, None] * across)


def _stay(
    upright: Member, sill: Floats, forward: Floats, across: Floats, parts: StayParts
) -> tuple[Member, float]:
    """The stay of an upright and its slope over the level, degrees."""
    part, joint = parts.profile, (parts.pivot.size_mm or (20.0, 40.0, 20.0))[1]
    foot, height = upright.axis_mm[0], upright.length_mm
    beside = float((foot - sill[0]) @ across)
    low = sill[0] + beside * across + (part.height_mm / 2.0 + joint) * Z
    high = foot + np.round(STAY_SHARE * height) * Z - (upright.size_mm[1] / 2.0 + joint) * forward
    run = high - low
    length = float(np.floor(np.linalg.norm(run)))
    # Cut to a whole millimetre; what is missing is in the pivots, half at each end.
    middle, along = (low + high) / 2.0, run / np.linalg.norm(run)
    axis = np.stack([middle - length / 2.0 * along, middle + length / 2.0 * along])
    slope = float(np.degrees(np.arctan2(run @ Z, run @ forward)))
    size = (part.width_mm, part.height_mm)
    return Member(f"{upright.id} stay", part.id, "stay", axis, across, size), slope
