"""Head positions for which a design must hold."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.arrays import Floats
from solver.limits import MotionBox

# Eight of the 64 corners of the box of six freedoms, in which every pair of freedoms meets in
# all four sign combinations: enough for visibility, which changes slowly with each of them.
_CORNERS = np.array([(x, y, z, x * y, x * z, y * z) for x, y, z in product((-1.0, 1.0), repeat=3)])


@dataclass(frozen=True, eq=False)
class HeadPosition:
    """A rigid motion of the head: ``x -> rotation (x - pivot) + pivot + translation``."""

    rotation: Floats
    translation_mm: Floats
    pivot_mm: Floats

    def points(self, points_mm: Floats) -> Floats:
        """Points (n, 3) of the head, moved."""
        return np.asarray(
            (points_mm - self.pivot_mm) @ self.rotation.T + self.pivot_mm + self.translation_mm
        )

    def directions(self, directions: Floats) -> Floats:
        """Directions (n, 3) fixed to the head, moved."""
        return np.asarray(directions @ self.rotation.T)

    def eye_seen_by_head(self, eye_mm: Floats) -> Floats:
        """Where points (..., 3) of the rig lie for somebody fixed to the head."""
        return np.asarray(
            (eye_mm - self.pivot_mm - self.translation_mm) @ self.rotation + self.pivot_mm
        )


def _position(box: MotionBox, signs: Floats, pivot_mm: Floats) -> HeadPosition:
    half_mm = np.array([box.x_mm, box.y_mm, box.z_mm])
    half_deg = np.array([box.pitch_deg, box.roll_deg, box.yaw_deg])
    rotation = Rotation.from_euler("xyz", signs[3:] * half_deg, degrees=True).as_matrix()
    return HeadPosition(rotation, signs[:3] * half_mm, pivot_mm)


def rest(pivot_mm: Floats) -> HeadPosition:
    """The head where it was scanned."""
    return HeadPosition(np.eye(3), np.zeros(3), pivot_mm)


def visibility_positions(box: MotionBox | None, pivot_mm: Floats) -> tuple[HeadPosition, ...]:
    """The rest position and, with a motion box, eight of its corners."""
    if box is None:
        return (rest(pivot_mm),)
    return (rest(pivot_mm), *(_position(box, signs, pivot_mm) for signs in _CORNERS))


def framing_positions(box: MotionBox | None, pivot_mm: Floats) -> tuple[HeadPosition, ...]:
    """All extreme positions of the box, and rotations by half and none of it.

    Framing and focus are linear in a point's position, so the corners of the translation are exact;
    a rotation moves points on arcs, so three values of each angle are taken.
    """
    if box is None:
        return (rest(pivot_mm),)
    translations = [(-1.0, 1.0) if h > 0.0 else (0.0,) for h in (box.x_mm, box.y_mm, box.z_mm)]
    rotations = [
        (-1.0, 0.0, 1.0) if h > 0.0 else (0.0,) for h in (box.pitch_deg, box.roll_deg, box.yaw_deg)
    ]
    corners = product(*translations, *rotations)
    return tuple(_position(box, np.array(signs), pivot_mm) for signs in corners)
