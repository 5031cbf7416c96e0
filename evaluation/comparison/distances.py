"""Signed distances of points to the closest point of a mesh (C2M), by libigl."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from evaluation.extras import igl
from geometry.arrays import Floats, Ints, frozen

_AT_ONCE = 200_000


@dataclass(frozen=True, eq=False)
class Reference:
    """The surface to compare with: ``vertices_mm`` (V, 3), ``faces`` (F, 3), wound outward."""

    vertices_mm: Floats
    faces: Ints

    def __post_init__(self) -> None:
        vertices = np.asarray(self.vertices_mm, dtype=np.float64)
        faces = np.asarray(self.faces, dtype=np.int64)
        if vertices.ndim != 2 or vertices.shape[1:] != (3,) or faces.shape[1:] != (3,):
            raise InputError("reference", "the reference is no triangle mesh", "give a mesh")
        if len(faces) == 0 or not np.isfinite(vertices).all():
            raise InputError(
                "reference-empty", "the reference has no faces, or vertices that are not finite",
                "give a mesh with faces",
            )  # fmt: skip
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise InputError(
                "reference", "the reference's faces name vertices that it lacks", "mend the mesh"
            )
        object.__setattr__(self, "vertices_mm", frozen(vertices))
        object.__setattr__(self, "faces", faces)

    def areas_mm2(self) -> Floats:
        """The area of each face, (F,)."""
        a, b, c = (self.vertices_mm[self.faces[:, k]] for k in range(3))
        return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0)

    def samples(self, spacing_mm: float, seed: int = 0) -> Floats:
        """The points of :meth:`sampled`."""
        return self.sampled(spacing_mm, seed)[0]

    def sampled(self, spacing_mm: float, seed: int = 0) -> tuple[Floats, Ints]:
        """Points (M, 3) spread evenly over the surface, and the face of each (M,).

        One for each ``spacing_mm`` squared.
        """
        area = self.areas_mm2()
        count = max(1, int(area.sum() / spacing_mm**2))
        rng = np.random.default_rng(seed)
        face = rng.choice(len(area), size=count, p=area / area.sum())
        u, v = rng.random(count), rng.random(count)
        flip = u + v > 1.0
        u, v = np.where(flip, 1.0 - u, u), np.where(flip, 1.0 - v, v)
        a, b, c = (self.vertices_mm[self.faces[face, k]] for k in range(3))
        return np.asarray(a + u[:, None] * (b - a) + v[:, None] * (c - a)), face


def signed_distances(points_mm: Floats, reference: Reference) -> tuple[Floats, Floats]:
    """Distance of each point (N,) to the surface, positive outside, and the closest points (N, 3).

    The sign follows the angle-weighted normal where the closest point is an edge or a corner
    (Baerentzen and Aanaes 2005): a face's own normal errs there.
    """
    library = igl()
    vertices = np.ascontiguousarray(reference.vertices_mm)
    faces = np.ascontiguousarray(reference.faces)
    kind = library.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    distances, closest = np.empty(len(points_mm)), np.empty((len(points_mm), 3))
    for begin in range(0, len(points_mm), _AT_ONCE):
        part = slice(begin, begin + _AT_ONCE)
        found = library.signed_distance(
            np.ascontiguousarray(points_mm[part], dtype=np.float64), vertices, faces, kind
        )
        distances[part], closest[part] = found[0], found[2]
    return distances, closest
