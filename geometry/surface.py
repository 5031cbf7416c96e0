"""Surface points: the object as photogrammetry sees it, points with outward normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, frozen


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
