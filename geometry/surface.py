"""Surface points: the object as photogrammetry sees it, points with outward normals."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from common.errors import InputError
from geometry.arrays import Bools, Floats, frozen

HULLS_KEPT = 128
"""A camera that is moved a little sees the same points: few sets are asked for again and again."""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """``points_mm`` (N, 3) in the rig frame with unit outward ``normals`` (N, 3)."""

    points_mm: Floats
    normals: Floats

    def __post_init__(self) -> None:
        points, normals = np.array(self.points_mm, float), np.array(self.normals, float)
        if points.ndim != 2 or points.shape[1:] != (3,) or points.shape != normals.shape:
            raise InputError(
                "points-shape", "points and normals must both be N x 3", "give one normal per point"
            )
        if len(points) == 0:
            raise InputError(
                "points-empty", "there are no points to photograph", "choose a larger face region"
            )
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        if not (np.isfinite(points).all() and np.isfinite(lengths).all() and (lengths > 0).all()):
            raise InputError(
                "points-not-finite",
                "points or normals are NaN, infinite or zero",
                "clean the scan first",
            )
        object.__setattr__(self, "points_mm", frozen(points))
        object.__setattr__(self, "normals", frozen(normals / lengths))

    def __len__(self) -> int:
        return len(self.points_mm)

    @property
    def centroid_mm(self) -> Floats:
        """Mean of the points, (3,)."""
        return np.asarray(self.points_mm.mean(axis=0))

    @property
    def radius_mm(self) -> float:
        """Largest distance of a point from the centroid."""
        return float(np.linalg.norm(self.points_mm - self.centroid_mm, axis=1).max())

    def subset(self, keep: np.ndarray) -> SurfacePoints:
        """The points selected by a mask or index array."""
        return SurfacePoints(self.points_mm[keep], self.normals[keep])

    @cached_property
    def _corners(self) -> dict[bytes, Floats]:
        return {}

    def corners_mm(self, of: Bools) -> Floats:
        """Corners (m, 3) of the convex hull of the points of a mask (N,), in their order.

        Flat or tiny sets are returned whole.
        """
        key = np.packbits(of).tobytes()
        found = self._corners.get(key)
        if found is None:
            if len(self._corners) >= HULLS_KEPT:
                self._corners.clear()
            found = self._corners[key] = frozen(_corners(self.points_mm[of]))
        return found


def _corners(points_mm: Floats) -> Floats:
    if len(points_mm) < 8:
        return points_mm
    try:
        return np.asarray(points_mm[ConvexHull(points_mm).vertices])
    except QhullError:
        return points_mm
