"""The subject as the report's figures need it: a light mesh and values on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from geometry.arrays import Bools, Floats, Ints
from geometry.raycast import Occluder
from geometry.subject import Subject
from geometry.viewmesh import simplified
from solver.result import PointTable

MESH_FACES = 16_000
REACH_IN_SPACINGS = 2.0
"""A place belongs to the region when a point of it is this near, in distances of neighbours."""


@dataclass(frozen=True, eq=False)
class Nearest:
    """For places (N,): the nearest point of the region (-1: none) and whether there is one."""

    index: Ints
    inside: Bools


class RegionLookup:
    """Which point of the region stands for a place on the surface."""

    def __init__(self, table: PointTable) -> None:
        points = table.points.points_mm
        self._tree = cKDTree(points)
        if len(points) > 1:
            distance = np.asarray(self._tree.query(points, k=2)[0])
            # A high percentile: points drawn at random leave gaps that are not holes.
            self.spacing_mm = float(np.percentile(distance[:, 1], 90.0))
        else:
            self.spacing_mm = 1.0

    def nearest(self, places_mm: Floats) -> Nearest:
        """The nearest point of each place (N, 3)."""
        if len(places_mm) == 0:
            return Nearest(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool))
        distance, index = self._tree.query(places_mm)
        inside = distance <= REACH_IN_SPACINGS * self.spacing_mm
        return Nearest(np.where(inside, index, -1).astype(np.int64), np.asarray(inside))


@dataclass(frozen=True, eq=False)
class ViewMesh:
    """A light mesh, ``vertices_mm`` (V, 3) and ``faces`` (F, 3).

    ``in_region`` (F,) marks the faces whose corners all have a point of the region near them,
    ``nearest`` (V,) says which one.
    """

    vertices_mm: Floats
    faces: Ints
    in_region: Bools
    nearest: Ints


def view_mesh(subject: Subject, lookup: RegionLookup, most_faces: int = MESH_FACES) -> ViewMesh:
    """The subject's whole mesh, light enough for a page; empty for bare points."""
    occluder = subject.occluder
    vertices, faces = simplified(occluder.vertices_mm, occluder.faces, most_faces)
    nearest = lookup.nearest(vertices)
    inside = nearest.inside[faces].all(axis=1) if len(faces) else np.zeros(0, dtype=bool)
    return ViewMesh(vertices, faces, np.asarray(inside), nearest.index)


@dataclass(frozen=True, eq=False)
class FrontView:
    """The subject seen from the front, as a raster of (rows, columns).

    ``x_mm`` (columns,) and ``z_mm`` (rows,) are the rig coordinates of the pixels; ``on_subject``
    says where the subject is, ``nearest`` which point of the region is there (-1: none) and
    ``shade`` how far the surface turns away from the front (0: faces it, 1: edge on).
    """

    x_mm: Floats
    z_mm: Floats
    on_subject: Bools
    nearest: Ints
    shade: Floats


def front_view(
    occluder: Occluder, table: PointTable, lookup: RegionLookup, columns: int = 180
) -> FrontView:
    """Look along +Y at the region and a margin about it."""
    points = table.points.points_mm
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.24 * (high - low).max()
    step = (high[0] - low[0] + 2.0 * margin) / columns
    x = np.arange(low[0] - margin, high[0] + margin, step)
    z = np.arange(low[2] - margin, high[2] + margin, step)
    grid_x, grid_z = np.meshgrid(x, z)
    y = occluder.vertices_mm[:, 1].min() - 10.0
    origins = np.stack([grid_x.ravel(), np.full(grid_x.size, y), grid_z.ravel()], axis=1)
    ahead = np.broadcast_to([0.0, 1.0, 0.0], origins.shape)
    triangle, distance = occluder.first_hits(origins, ahead)
    hit = triangle >= 0
    nearest, shade = np.full(len(origins), -1, dtype=np.int64), np.ones(len(origins))
    nearest[hit] = lookup.nearest(origins[hit] + distance[hit, None] * ahead[hit]).index
    normals = occluder.face_normals(triangle[hit])
    shade[hit] = 1.0 - np.clip(normals @ _lamp(), 0.0, 1.0)
    shape = grid_x.shape
    return FrontView(x, z, hit.reshape(shape), nearest.reshape(shape), shade.reshape(shape))


def _lamp() -> Floats:
    """A lamp above the viewer's left shoulder, as portraits are lit."""
    lamp = np.array([-0.35, -0.85, 0.45])
    return np.asarray(lamp / np.linalg.norm(lamp))
