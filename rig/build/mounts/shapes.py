"""Gaps between many convex solids: bounding boxes first, then faces, then the exact distance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from geometry.arrays import Floats
from rig.solids.convex import signed_distance


@dataclass(frozen=True, eq=False)
class ConvexShape:
    """The convex hull of ``corners_mm`` (K, 3)."""

    corners_mm: Floats

    @cached_property
    def low_mm(self) -> Floats:
        """Least corner of the bounding box, (3,)."""
        return np.asarray(self.corners_mm.min(axis=0))

    @cached_property
    def high_mm(self) -> Floats:
        """Greatest corner of the bounding box, (3,)."""
        return np.asarray(self.corners_mm.max(axis=0))

    @cached_property
    def faces(self) -> Floats:
        """Outward unit normals and offsets (F, 4): inside is ``n . x + d <= 0``."""
        try:
            return np.unique(ConvexHull(self.corners_mm).equations.round(9), axis=0)
        except (QhullError, ValueError):
            # Flat or too few corners: no face can show that something lies outside of it.
            return np.zeros((0, 4))

    def face_gap_mm(self, other: ConvexShape) -> float:
        """How far ``other`` lies outside of the face that keeps it out best."""
        faces = self.faces
        if not len(faces):
            return -np.inf
        return float((other.corners_mm @ faces[:, :3].T + faces[:, 3]).min(axis=0).max())


def gap_mm(one: ConvexShape, other: ConvexShape, enough_mm: float) -> float:
    """The gap, negative for an overlap; ``enough_mm`` or more is not told exactly."""
    bound = max(one.face_gap_mm(other), other.face_gap_mm(one))
    if bound >= enough_mm:
        return bound
    return signed_distance(one.corners_mm, other.corners_mm)


class Crowd:
    """Solids in their places, to be asked what is near a new one."""

    def __init__(self, shapes: list[ConvexShape] | None = None) -> None:
        self.shapes: list[ConvexShape] = []
        self._low = np.zeros((0, 3))
        self._high = np.zeros((0, 3))
        self.add(shapes or [])

    def add(self, shapes: list[ConvexShape]) -> None:
        """Put more solids in."""
        if shapes:
            self.shapes += shapes
            self._low = np.concatenate([self._low, [s.low_mm for s in shapes]])
            self._high = np.concatenate([self._high, [s.high_mm for s in shapes]])

    def near(self, shape: ConvexShape, within_mm: float) -> list[int]:
        """Indices of the solids whose bounding box comes that near."""
        apart = np.maximum(self._low - shape.high_mm, shape.low_mm - self._high).max(axis=1)
        return [int(k) for k in np.flatnonzero(apart < within_mm)]
