"""From a cloud with normals to a mesh whose holes stay holes.

The signed distance to the local tangent planes (Hoppe et al. 1992), weighted by nearness and
certainty (Kolluri 2005), at the corners of cubes near the points; marching cubes (libigl) where
all eight corners know it. Poisson's method closes what nobody saw, and its wheels weigh a hundred
megabytes and more; libigl is there for distances already.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from common.errors import InputError
from evaluation.extras import igl
from evaluation.reconstruction.cloud import Bytes, Cloud
from geometry.arrays import Bools, Floats, Ints, frozen

_COARSENESS = 1.5
"""Edge of a cube in spacings of the points: finer ones leave holes between the points."""

SMALLEST_PIECE_MM2 = 10.0
"""What hangs together on less is no part of a face: a few patches that agree by accident."""

_NEAREST = 16
_ACROSS = 1.8
"""How far before and behind the surface the distance is known, in edges of a cube."""
_STEEPEST = 1.9
"""A distance changes by no more than the way: sqrt(3) edges in a cube, and a tenth for noise.
Midway between two sheets it jumps, and no surface is there."""
_BESIDE = 1.0
"""How far beside the middle of its points: farther would be a guess beyond the rim."""
_AT_ONCE = 100_000

_CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)
"""Corners of a cube in libigl's order."""


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """A measured surface. Where nothing was measured it has a hole.

    ``vertices_mm``, ``normals`` (V, 3) in the rig frame, ``faces`` (F, 3) wound outward,
    ``colours`` (V, 3) RGB of 8 bits, ``sigma_mm`` (V,) standard deviation along the normal.
    """

    vertices_mm: Floats
    faces: Ints
    normals: Floats
    colours: Bytes
    sigma_mm: Floats

    def __post_init__(self) -> None:
        count = len(self.vertices_mm)
        if any(len(v) != count for v in (self.normals, self.colours, self.sigma_mm)):
            raise InputError(
                "mesh", "a mesh's vertices, normals, colours and sigmas do not match",
                "give one of each for every vertex",
            )  # fmt: skip
        for name in ("vertices_mm", "normals", "sigma_mm"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def area_mm2(self) -> float:
        """The area of all faces."""
        return float(_areas(self.vertices_mm, self.faces).sum())

    def rims(self) -> Ints:
        """Edges (E, 2) that have a face on one side only: where holes and the outside begin."""
        edges = self.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        _, first, count = np.unique(
            np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True
        )
        return np.asarray(edges[first[count == 1]])


def spacing_mm(cloud: Cloud) -> float:
    """Edge of the square that each point has for itself, where half of the points are denser."""
    neighbours = min(8, len(cloud) - 1)
    tree = cKDTree(cloud.points_mm)
    some = cloud.points_mm[:: max(1, len(cloud) // 20_000)]
    reach = float(np.median(tree.query(some, k=[neighbours + 1])[0]))
    return reach * float(np.sqrt(np.pi / neighbours))


def meshed(cloud: Cloud, cell_mm: float | None = None, workers: int = 1) -> SurfaceMesh:
    """The surface through the points of a cloud.

    ``cell_mm``: edge of the cubes, about that of the triangles; without it 1.5 times the spacing
    of the points. Raises :class:`InputError` where the points make no surface.
    """
    if len(cloud) < _NEAREST:
        raise _no_surface()
    cell = cell_mm or _COARSENESS * spacing_mm(cloud)
    tree = cKDTree(cloud.points_mm)
    corners, cubes = _cubes(cloud.points_mm, cell)
    field, known = _field(cloud, tree, corners, cell, workers)
    cubes = cubes[known[cubes].all(axis=1)]
    high, low = field[cubes].max(axis=1), field[cubes].min(axis=1)
    crossed = (high > 0.0) & (low <= 0.0) & (high - low <= _STEEPEST * cell)
    if not crossed.any():
        raise _no_surface()
    used, cubes = np.unique(cubes[crossed], return_inverse=True)
    vertices, faces, _ = igl().marching_cubes(
        field[used], corners[used], np.ascontiguousarray(cubes.reshape(-1, 8)), 0.0
    )
    vertices, faces = _pieces(vertices, faces)
    if len(faces) == 0:
        raise _no_surface()
    return _dressed(cloud, tree, vertices, faces, workers)


def _no_surface() -> InputError:
    return InputError(
        "no-surface",
        "the points are too few or too scattered to make a surface",
        "give a denser cloud, or a larger --cell",
    )


def _cubes(points_mm: Floats, cell_mm: float) -> tuple[Floats, Ints]:
    """Corners (C, 3) and cubes (M, 8) of all cells that hold a point or touch one that does."""
    origin = points_mm.min(axis=0) - 2.0 * cell_mm
    holding = np.floor((points_mm - origin) / cell_mm).astype(np.int64)
    # One number for a cell: places beyond 2^20 cells are no head.
    steps = np.array([1 << 42, 1 << 21, 1], dtype=np.int64)
    around = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = np.unique((np.unique(holding @ steps)[:, None] + around @ steps).ravel())
    at_corners = np.asarray(cells[:, None] + _CORNERS @ steps, dtype=np.int64)
    keys, cubes = np.unique(at_corners, return_inverse=True)
    place = np.stack([keys >> 42, (keys >> 21) & 0x1FFFFF, keys & 0x1FFFFF], axis=1)
    return np.asarray(origin + place * cell_mm), cubes.reshape(-1, 8)


def _field(
    cloud: Cloud, tree: cKDTree, places: Floats, cell_mm: float, workers: int
) -> tuple[Floats, Bools]:
    """Signed distance to the surface at each place (C,), and whether it is known there (C,)."""
    field, known = np.empty(len(places)), np.empty(len(places), dtype=bool)
    for begin in range(0, len(places), _AT_ONCE):
        part = slice(begin, begin + _AT_ONCE)
        near, weight = _weights(cloud, tree, places[part], cell_mm, workers)
        total = weight.sum(axis=1)
        weight = weight / np.maximum(total, 1e-300)[:, None]
        offset = places[part][:, None] - cloud.points_mm[near]
        along = np.einsum("nki,nki->nk", offset, cloud.normals[near])
        field[part] = np.einsum("nk,nk->n", weight, along)
        normal = np.einsum("nk,nki->ni", weight, cloud.normals[near])
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
        middle = np.einsum("nk,nki->ni", weight, offset)
        across = np.einsum("ni,ni->n", middle, normal)
        beside = np.linalg.norm(middle - across[:, None] * normal, axis=1)
        known[part] = (
            (total > 0.0)
            & ((weight > 0.0).sum(axis=1) >= 3)
            & (np.abs(field[part]) <= _ACROSS * cell_mm)
            & (beside <= _BESIDE * cell_mm)
        )
    return field, known


def _weights(
    cloud: Cloud, tree: cKDTree, places: Floats, cell_mm: float, workers: int
) -> tuple[Ints, Floats]:
    """The points near each place (N, k) and what each says (N, k): the nearer and surer, the more.

    Points of another sheet, whose normal turns away from that of the nearest, say nothing.
    """
    distance, near = tree.query(
        places, k=_NEAREST, distance_upper_bound=3.0 * cell_mm, workers=workers
    )
    there = np.isfinite(distance)
    near = np.where(there, near, 0)
    same = np.einsum("nki,ni->nk", cloud.normals[near], cloud.normals[near[:, 0]]) > 0.3
    least = float(np.median(cloud.sigma_mm))
    sure = 1.0 / (cloud.sigma_mm[near] ** 2 + least**2)
    nearness = np.exp(-((np.where(there, distance, 0.0) / cell_mm) ** 2))
    return near, np.where(there & same, nearness * sure, 0.0)


def _areas(vertices: Floats, faces: Ints) -> Floats:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0)


def _pieces(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Without the pieces that are too small, and without vertices that no face uses."""
    area = _areas(vertices, faces)
    faces, area = faces[area > 0.0], area[area > 0.0]
    if len(faces) == 0:
        return vertices[:0], faces
    piece = igl().vertex_components(faces)[faces[:, 0]]
    faces = faces[np.bincount(piece, weights=area)[piece] >= SMALLEST_PIECE_MM2]
    used, packed = np.unique(faces, return_inverse=True)
    return vertices[used], packed.reshape(-1, 3)


def _dressed(
    cloud: Cloud, tree: cKDTree, vertices: Floats, faces: Ints, workers: int
) -> SurfaceMesh:
    """Normals, colours and sigmas from the nearest points."""
    found = tree.query(vertices, k=6, workers=workers)
    distance, near = np.asarray(found[0]), np.asarray(found[1])
    weight = 1.0 / (distance + 0.25 * distance.mean() + 1e-9)
    weight = weight / weight.sum(axis=1, keepdims=True)
    normals = np.einsum("nk,nki->ni", weight, cloud.normals[near])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    colours = np.einsum("nk,nki->ni", weight, cloud.colours[near].astype(np.float64))
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    outward = np.einsum("ni,ni->n", np.cross(b - a, c - a), normals[faces[:, 0]])
    if outward.sum() < 0.0:
        faces = faces[:, ::-1]
    return SurfaceMesh(
        vertices,
        np.ascontiguousarray(faces),
        normals,
        np.rint(colours).astype(np.uint8),
        np.einsum("nk,nk->n", weight, cloud.sigma_mm[near]),
    )
