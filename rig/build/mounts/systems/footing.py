"""Where the base of a printed wedge is screwed down: clear of the camera, in reach of a key.

A camera is screwed onto its wedge from below, so the wedge goes onto its post with the camera on
it. Its base screws are then turned from above, by a key along the base's normal: no part of
camera, lens or seat may be over them, and the way of the camera's own screw may not take the
material away from under their heads.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from rig.build.wedges.fastenings import Room
from rig.build.wedges.recipe import CLEARANCE_MM
from rig.build.wedges.shape import FLANGE_MM

SEAT_REACH_MM = 30.0
"""Base at the end without screws: no seat reaches further, however it leans."""

PITCH_MM = 25.0
"""From the first row of screws to the second."""

EDGE_MM = 9.0
"""From the second row to the end of the base: a head M5 with 4 mm beside it."""

ROOF = float(np.sqrt(2.0))
"""Holes are printed with a roof of 45 degrees: so much further they reach on one side."""

SIDES = 24


@dataclass(frozen=True)
class BaseFooting:
    """A base along a post, seen from the point under the camera's thread, y towards the front.

    It reaches from ``-rear_mm`` to ``front_mm``; ``rows_mm`` are the y of its two rows of screws,
    ``slot_mm`` how far the post's slots lie from its middle.
    """

    front_mm: float
    rear_mm: float
    rows_mm: tuple[float, float]
    slot_mm: float

    @property
    def length_mm(self) -> float:
        """Length of the base."""
        return self.front_mm + self.rear_mm

    @property
    def middle_mm(self) -> float:
        """The y of its middle."""
        return (self.front_mm - self.rear_mm) / 2.0


def clear_footing(
    blocks: list[Floats],
    seat_mm: float,
    normal: Floats,
    screws: tuple[Room, Room],
    slot_mm: float,
    *,
    ahead: bool,
) -> BaseFooting:
    """The shortest base whose screws are free of ``blocks``, convex solids (N, 3) over it.

    ``seat_mm``: height of the seat; ``normal`` (3,): where it faces; ``screws``: the camera's and
    the base's. All in the base's axes, from the point under the camera's thread. The screws lie
    behind the camera, or ``ahead`` of it.
    """
    camera, base = (ROOF * (room.head_diameter_mm + CLEARANCE_MM) / 2.0 for room in screws)
    solids = [block[:, :2] for block in blocks] + [_screw_way(seat_mm, normal, camera)]
    way = np.array([1.0, -1.0 if ahead else 1.0])
    ends = [_rearmost(solid * way, sign * slot_mm, base) for solid in solids for sign in (-1, 1)]
    first = float(np.ceil(base - min(0.0, *ends)))
    second = first + PITCH_MM
    if ahead:
        return BaseFooting(second + EDGE_MM, SEAT_REACH_MM, (first, second), slot_mm)
    return BaseFooting(SEAT_REACH_MM, second + EDGE_MM, (-first, -second), slot_mm)


def _screw_way(seat_mm: float, normal: Floats, radius_mm: float) -> Floats:
    """Outline (2 SIDES, 2) of the camera screw's way where it goes through the base."""
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    level = np.hypot(normal[0], normal[1])
    lean = normal[:2] / level if level > 0.0 else np.array([1.0, 0.0])
    across = np.array([-lean[1], lean[0]])
    ring = radius_mm * (np.outer(np.cos(angle) / normal[2], lean) + np.outer(np.sin(angle), across))
    feet = [-normal[:2] * (seat_mm - height) / normal[2] for height in (0.0, FLANGE_MM)]
    return np.concatenate([ring + foot for foot in feet])


def _rearmost(points: Floats, x_mm: float, half_mm: float) -> float:
    """Least y of the hull of ``points`` (N, 2) within ``half_mm`` of ``x_mm``; inf without any."""
    low, high = x_mm - half_mm, x_mm + half_mm
    x, y = points.T
    found = [y[(x >= low) & (x <= high)]]
    # The hull's corners on the strip's borders lie on lines between two of the points.
    for border in (low, high):
        i, k = np.nonzero((x[:, None] < border) & (x[None, :] > border))
        share = (border - x[i]) / (x[k] - x[i])
        found.append(y[i] + share * (y[k] - y[i]))
    return float(np.concatenate(found).min(initial=np.inf))
