"""Normals of point clouds, found from the neighbourhood of each point and turned outward."""

from __future__ import annotations

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, Ints
from geometry.cleaning import unique_rows
from geometry.loading import RawScan
from geometry.scan import ScanNote

_NEIGHBOURS = 12
_CHUNK = 200_000
_MIN_POINTS = 4
_MIN_POINTS_WITHOUT_NORMALS = 100


def clean_cloud(raw: RawScan, *, closed: bool) -> tuple[Floats, Floats, tuple[ScanNote, ...]]:
    """Points (P, 3), outward unit normals (P, 3) and notes of a scan without faces.

    Given normals of a ``closed`` surface, such as a head's, are turned when they point inward.
    Raises :class:`InputError` for fewer than four different points, or a hundred without normals.
    """
    size = float(np.ptp(raw.vertices, axis=0).max())
    local = (raw.vertices - raw.vertices.min(axis=0)) / max(size * 1e-7, 1e-300)
    first = np.sort(unique_rows(np.round(local).astype(np.int64))[0])
    notes = []
    if len(first) < len(raw.vertices):
        text = f"{len(raw.vertices) - len(first):,} points at the same place dropped"
        notes.append(ScanNote("changed", text))
    points = raw.vertices[first]
    given = None if raw.normals is None else _unit(raw.normals[first])
    least = _MIN_POINTS_WITHOUT_NORMALS if given is None else _MIN_POINTS
    if len(points) < least:
        problem = f"the scan has {len(points)} different points; {least} are the least"
        raise InputError("scan-too-few-points", problem, "export it again with its geometry")
    if given is None:
        notes.append(ScanNote("inferred", f"normals: from {_NEIGHBOURS} neighbours of each point"))
        return points, outward_normals(points), tuple(notes)
    if closed and np.einsum("ij,ij->", given, points - points.mean(axis=0)) < 0.0:
        notes.append(ScanNote("changed", f"{len(points):,} normals turned to point outward"))
        given = -given
    return points, given, tuple(notes)


def _unit(normals: Floats) -> Floats | None:
    """Unit normals, or None when some have no direction."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    if not (np.isfinite(length).all() and (length > 1e-12).all()):
        return None
    return np.asarray(normals / length)


def outward_normals(points: Floats) -> Floats:
    """Unit normals (P, 3) of a cloud (P, 3): planes through neighbours, turned to agree.

    The turn is carried along a minimum spanning tree of the neighbour graph, from the point
    farthest from the centroid, where outward is certain (Hoppe et al., 1992).
    """
    from scipy.spatial import cKDTree

    _, neighbours = cKDTree(points).query(points, k=min(_NEIGHBOURS + 1, len(points)))
    neighbours = np.asarray(neighbours, dtype=np.int64)
    normals = np.empty_like(points)
    for start in range(0, len(points), _CHUNK):
        local = points[neighbours[start : start + _CHUNK]]
        local = local - local.mean(axis=1, keepdims=True)
        _, vectors = np.linalg.eigh(np.einsum("pki,pkj->pij", local, local))
        normals[start : start + _CHUNK] = vectors[:, :, 0]
    return _turned(points, normals, neighbours)


def _turned(points: Floats, normals: Floats, neighbours: Ints) -> Floats:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import (
        breadth_first_order,
        connected_components,
        minimum_spanning_tree,
    )

    count = len(points)
    rows = np.repeat(np.arange(count), neighbours.shape[1] - 1)
    columns = neighbours[:, 1:].ravel()
    agreement = np.abs(np.einsum("ij,ij->i", normals[rows], normals[columns]))
    # The sparse graph would take a weight of zero for no edge.
    weights = 1.0 - np.minimum(agreement, 1.0) + 1e-6
    graph = coo_array((weights, (rows, columns)), (count, count)).tocsr()
    tree = minimum_spanning_tree(graph.maximum(graph.T))
    pieces, label = connected_components(tree, directed=False)
    away = points - points.mean(axis=0)
    distance = np.linalg.norm(away, axis=1)
    # Farthest first within each piece: the first of each piece is its root.
    order = np.lexsort((-distance, label))
    roots = order[np.searchsorted(label[order], np.arange(pieces))]
    # One more node joins all roots, so that a single walk reaches every piece.
    links = tree.tocoo()
    rows = np.append(links.row, np.full(pieces, count)).astype(np.int64)
    columns = np.append(links.col, roots).astype(np.int64)
    joined = coo_array(
        (np.append(links.data, np.ones(pieces)), (rows, columns)), (count + 1, count + 1)
    )
    _, before = breadth_first_order(joined.tocsr(), count, directed=False)
    parent = before[:count].astype(np.int64)
    parent[roots] = roots
    sign = np.where(np.einsum("ij,ij->i", normals, normals[parent]) < 0.0, -1.0, 1.0)
    sign[roots] = np.where(np.einsum("ij,ij->i", normals[roots], away[roots]) < 0.0, -1.0, 1.0)
    return normals * _product_to_root(sign, parent)[:, None]


def _product_to_root(sign: Floats, parent: Ints) -> Floats:
    """Product of the signs along the way from each point to its root, (P,).

    Every step doubles the way that is covered, so a long tree takes few steps.
    """
    root_sign = sign.copy()
    is_root = parent == np.arange(len(parent))
    sign = np.where(is_root, 1.0, sign)
    while (parent[parent] != parent).any():
        sign = sign * sign[parent]
        parent = parent[parent]
    return sign * np.where(is_root, 1.0, sign[parent]) * root_sign[parent]
