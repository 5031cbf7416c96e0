"""Which camera colours each triangle of a surface: the one that sees it with most pixels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from evaluation.reconstruction.surface import SurfaceMesh
from evaluation.reconstruction.views import View
from geometry.arrays import Bools, Floats, Ints
from geometry.raycast import Occluder

NOBODY = -1
"""Label of a triangle that no camera sees whole."""

_SMOOTHED = 12
"""Steps in which triangles hear their neighbours, so that seams are few: about as many wide."""
_LEAST_TOGETHER = 300
"""Islands of fewer triangles take the camera that surrounds them, where it sees them."""
_ISLAND_ROUNDS = 4


def projected(view: View, points_mm: Floats) -> tuple[Floats, Floats]:
    """Pixels (N, 2) of an undistorted view, centres at integers, and depths (N,), mm."""
    there = view.pose.to_camera(points_mm)
    with np.errstate(divide="ignore", invalid="ignore"):
        plain = there / there[:, 2:]
    return np.asarray((plain @ view.matrix.T)[:, :2]), np.asarray(there[:, 2])


def seen_vertices(view: View, mesh: SurfaceMesh, occluder: Occluder) -> tuple[Floats, Bools]:
    """Pixels (V, 2) of the vertices, and which (V,) show there: in the picture, not hidden.

    Where the picture is saturated it has no colour to give.
    """
    pixel, depth = projected(view, mesh.vertices_mm)
    width, height = view.size_px
    with np.errstate(invalid="ignore"):
        inside = (depth > 0.0) & (pixel >= 1.0).all(axis=1)
        inside &= (pixel[:, 0] <= width - 2) & (pixel[:, 1] <= height - 2)
    tried = np.flatnonzero(inside)
    column, row = np.rint(pixel[tried]).astype(np.int64).T
    tried = tried[~view.clipped[row, column]]
    eye = view.pose.position_rig_mm
    free = ~occluder.hidden(mesh.vertices_mm[tried], mesh.normals[tried], eye)
    seen = np.zeros(len(mesh.vertices_mm), dtype=bool)
    seen[tried[free]] = True
    return pixel, seen


def area_px(pixel: Floats, faces: Ints) -> Floats:
    """Pixels that each triangle covers (F,), negative where its back shows."""
    a, b, c = (pixel[faces[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    # Rows count downward: what is wound outward turns clockwise in a picture.
    return np.asarray(0.5 * (uy * vx - ux * vy))


def neighbours(faces: Ints) -> tuple[Ints, Ints]:
    """Pairs of triangles (E,), (E,) that share an edge."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    key = edges[:, 0] * (int(faces.max()) + 1) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    return order[same] // 3, order[same + 1] // 3


def best_views(pixels: Sequence[Floats], seen: Sequence[Bools], mesh: SurfaceMesh) -> Ints:
    """The camera that colours each triangle (F,), ``NOBODY`` where none sees all its corners.

    ``pixels`` (V, 2) and ``seen`` (V,) of each camera, as :func:`seen_vertices` gives them.
    """
    faces = mesh.faces
    covers = np.stack([area_px(p, faces) for p in pixels])
    able = np.stack([s[faces].all(axis=1) for s in seen]) & (covers > 0.0)
    score = np.where(able, covers, 0.0)
    score /= np.maximum(score.max(axis=0), 1e-12)
    first, second = neighbours(faces)
    ones = np.ones(len(first))
    near = sparse.coo_matrix((ones, (first, second)), shape=(len(faces),) * 2).tocsr()
    near = near + near.T + sparse.identity(len(faces), format="csr")
    share = 1.0 / np.asarray(near.sum(axis=1)).ravel()
    for _ in range(_SMOOTHED):
        score = (near @ score.T).T * share
    label = np.where(able.any(axis=0), np.where(able, score, -1.0).argmax(axis=0), NOBODY)
    for _ in range(_ISLAND_ROUNDS):
        label = _without_islands(label, able, first, second)
    return np.asarray(label, dtype=np.int64)


def _without_islands(label: Ints, able: Bools, first: Ints, second: Ints) -> Ints:
    """Small islands with the label that most of their neighbours outside have."""
    count = len(label)
    same = label[first] == label[second]
    inner = (np.ones(int(same.sum())), (first[same], second[same]))
    graph = sparse.coo_matrix(inner, shape=(count, count))
    _, island = sparse.csgraph.connected_components(graph, directed=False)
    small = np.bincount(island)[island] < _LEAST_TOGETHER
    small &= label != NOBODY
    cross = np.flatnonzero(~same)
    ends = np.stack([np.r_[first[cross], second[cross]], np.r_[second[cross], first[cross]]])
    ends = ends[:, small[ends[0]] & (label[ends[1]] != NOBODY)]
    votes = np.zeros((int(island.max()) + 1, len(able)))
    np.add.at(votes, (island[ends[0]], label[ends[1]]), 1.0)
    wanted, asked = votes.argmax(axis=1)[island], votes.max(axis=1)[island] > 0.0
    moved = small & asked & able[wanted, np.arange(count)]
    return np.where(moved, wanted, label)
