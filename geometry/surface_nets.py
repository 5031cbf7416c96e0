"""Meshing of an implicit solid by naive surface nets, on a grid of uneven spacing.

One vertex per grid cell that the surface crosses, one quadrilateral per crossed grid edge
(S. F. F. Gibson, Constrained elastic surface nets, MICCAI 1998). Closed by construction as long
as the solid stays off the border of the grid.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from geometry.arrays import Floats, Ints

Field = Callable[[Floats], Floats]

_COARSE = 4
"""The field is first evaluated on every fourth grid node only."""

_MAX_PASSES = 50

_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_EDGES = [
    (a, b)
    for a in range(8)
    for b in range(a + 1, 8)
    if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 1
]


def grid_values(field: Field, axes: tuple[Floats, Floats, Floats]) -> Floats:
    """Values of ``field`` on the grid of ``axes``, (nx, ny, nz), exact near its surface.

    Far from the surface only the sign is meant: there, values are those of the nearest coarse
    node. The field must change by at most about its distance (a distance bound), or thin parts
    are lost.
    """
    shape = tuple(len(a) for a in axes)
    picks = [np.unique(np.append(np.arange(0, n, _COARSE), n - 1)) for n in shape]
    coarse = field(_nodes([a[p] for a, p in zip(axes, picks, strict=True)]))
    coarse = coarse.reshape([len(p) for p in picks])
    nearest = [
        np.clip(np.rint(np.arange(n) / _COARSE).astype(int), 0, len(p) - 1)
        for n, p in zip(shape, picks, strict=True)
    ]
    values = coarse[np.ix_(*nearest)]
    # A node is at most half a coarse cell's diagonal from the coarse node that stands for it;
    # twice that covers the error of first-order distances.
    step = max(float(np.diff(a[p]).max()) for a, p in zip(axes, picks, strict=True))
    near = np.flatnonzero(np.abs(values).ravel() < np.sqrt(3.0) * step)
    index = np.unravel_index(near, shape)
    points = np.stack([a[i] for a, i in zip(axes, index, strict=True)], axis=1)
    flat = values.ravel()
    flat[near] = field(points)
    return flat.reshape(shape)


def unambiguous(values: Floats) -> Floats:
    """Values in which no grid square has its corners inside and outside crosswise.

    Such squares would make four faces meet at one edge. Of the two inside corners the one
    nearer the surface is put outside, which moves the surface by less than a cell.
    """
    out = values.copy()
    for _ in range(_MAX_PASSES):
        changed = False
        for u, v in ((0, 1), (1, 2), (0, 2)):
            changed |= _uncross(np.moveaxis(out, (u, v), (0, 1)))
        if not changed:
            break
    return out


def _uncross(values: Floats) -> bool:
    """Resolve the crossed squares of the first two axes in place; whether there were any."""
    a, b, c, d = values[:-1, :-1], values[1:, :-1], values[1:, 1:], values[:-1, 1:]
    found = False
    for first, second, others in ((a, c, (b, d)), (b, d, (a, c))):
        crossed = (first < 0.0) & (second < 0.0) & (others[0] >= 0.0) & (others[1] >= 0.0)
        if crossed.any():
            found = True
            nearer = crossed & (first >= second)
            first[nearer] = 1e-6
            second[crossed & ~nearer] = 1e-6
    return found


def largest_piece(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """The piece of a mesh with the most faces, on the vertices that it uses."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(vertices),) * 2)
    label = connected_components(graph, directed=False)[1][faces[:, 0]]
    kept = faces[label == np.bincount(label).argmax()]
    used, numbered = np.unique(kept, return_inverse=True)
    return vertices[used], numbered.reshape(-1, 3)


def _nodes(axes: list[Floats]) -> Floats:
    return np.stack([g.ravel() for g in np.meshgrid(*axes, indexing="ij")], axis=1)


def surface_nets(values: Floats, axes: tuple[Floats, Floats, Floats]) -> tuple[Floats, Ints]:
    """Vertices (V, 3) and triangles (F, 3), wound outwards, of the surface where values are 0."""
    inside = values < 0.0
    cell_shape = tuple(n - 1 for n in values.shape)
    corners = [values[_window(c, cell_shape)] for c in _CORNERS]
    count = np.sum([c < 0.0 for c in corners], axis=0, dtype=np.int8)
    cells = np.flatnonzero(((count > 0) & (count < 8)).ravel())
    vertices = _cell_vertices(corners, cells, cell_shape, axes)
    number = np.full(int(np.prod(cell_shape)), -1, dtype=np.int64)
    number[cells] = np.arange(len(cells))
    faces = [_axis_faces(inside, number.reshape(cell_shape), axis) for axis in range(3)]
    return vertices, _split(np.concatenate(faces), vertices)


def _window(corner: Ints, cell_shape: tuple[int, ...]) -> tuple[slice, ...]:
    return tuple(slice(int(o), int(o) + n) for o, n in zip(corner, cell_shape, strict=True))


def _cell_vertices(
    corners: list[Floats], cells: Ints, cell_shape: tuple[int, ...], axes: tuple[Floats, ...]
) -> Floats:
    """Mean of the points where the surface crosses the edges of each cell, (V, 3)."""
    at = np.stack([c.ravel()[cells] for c in corners], axis=1)
    total, crossings = np.zeros((len(cells), 3)), np.zeros(len(cells))
    for a, b in _EDGES:
        va, vb = at[:, a], at[:, b]
        crossed = (va < 0.0) != (vb < 0.0)
        share = np.where(crossed, va / np.where(crossed, va - vb, 1.0), 0.0)
        point = _CORNERS[a] + share[:, None] * (_CORNERS[b] - _CORNERS[a])
        total += np.where(crossed[:, None], point, 0.0)
        crossings += crossed
    local = total / crossings[:, None]
    index = np.stack(np.unravel_index(cells, cell_shape), axis=1)
    low = np.stack([axes[k][index[:, k]] for k in range(3)], axis=1)
    high = np.stack([axes[k][index[:, k] + 1] for k in range(3)], axis=1)
    return np.asarray(low + local * (high - low))


def _axis_faces(inside: np.ndarray, number: Ints, axis: int) -> Ints:
    """Quadrilaterals (Q, 4) around the grid edges along ``axis`` that the surface crosses."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    n = inside.shape
    interior = [slice(None)] * 3
    interior[u], interior[v] = slice(1, n[u] - 1), slice(1, n[v] - 1)
    first, second = list(interior), list(interior)
    first[axis], second[axis] = slice(0, n[axis] - 1), slice(1, n[axis])
    low, high = inside[tuple(first)], inside[tuple(second)]
    index = np.stack(np.nonzero(low != high), axis=1)
    index[:, u] += 1
    index[:, v] += 1
    ring = []
    for du, dv in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
        cell = index.copy()
        cell[:, u] += du
        cell[:, v] += dv
        ring.append(number[cell[:, 0], cell[:, 1], cell[:, 2]])
    quads = np.stack(ring, axis=1)
    # Counter-clockwise about +axis as built; that is outwards only where the inside is below.
    leaves = low[low != high]
    return np.where(leaves[:, None], quads, quads[:, ::-1])


def _split(quads: Ints, vertices: Floats) -> Ints:
    """Two triangles per quadrilateral, along the shorter diagonal."""
    p = vertices[quads]
    short = np.linalg.norm(p[:, 0] - p[:, 2], axis=1) <= np.linalg.norm(p[:, 1] - p[:, 3], axis=1)
    order = np.where(short[:, None], np.array([0, 1, 2, 0, 2, 3]), np.array([1, 2, 3, 1, 3, 0]))
    return np.take_along_axis(quads, order, axis=1).reshape(-1, 3)


def settle(vertices: Floats, field: Field, steps: int = 2, reach: float = 0.5) -> Floats:
    """Vertices moved onto the surface of ``field`` by Newton steps of at most ``reach``."""
    moved = vertices.copy()
    h = 1e-3
    for _ in range(steps):
        value = field(moved)
        gradient = np.stack([(field(moved + h * e) - value) / h for e in np.eye(3)], axis=1)
        square = np.maximum(np.einsum("ij,ij->i", gradient, gradient), 1e-3)
        move = -(value / square)[:, None] * gradient
        length = np.linalg.norm(move, axis=1, keepdims=True)
        moved += move * np.minimum(1.0, reach / np.maximum(length, 1e-12))
    return moved
