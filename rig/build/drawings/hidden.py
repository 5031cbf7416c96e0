"""Which edges of convex solids a viewer sees, exactly.

A point of an edge is hidden by a solid when the ray from it to the viewer meets the solid's
inside. For a convex solid the hidden part of an edge is one interval, which follows from the
solid's face planes by eliminating the distance along the ray.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull

from geometry.arrays import Floats, Ints

SHARP = np.cos(np.radians(25.0))
"""Edges between faces that differ by less are those of a round lens: only its outline shows."""

SHRINK_MM = 0.05
"""Solids hide as if they were this much smaller: faces that touch hide no edges of each other."""

FLAT = 1e-9
SHORTEST_MM = 0.2


class _Solid:
    """Planes (F, 4) and drawn edges (E, 2, 3) of a convex solid, in view coordinates."""

    def __init__(self, corners: Floats) -> None:
        hull = ConvexHull(corners)
        self.planes = np.unique(np.round(hull.equations, 7), axis=0)
        self.low, self.high = corners.min(axis=0), corners.max(axis=0)
        self.edges = _drawn_edges(corners, hull)


def _drawn_edges(corners: Floats, hull: ConvexHull) -> Floats:
    """Edges that a viewer at +z sees of the solid alone: sharp ones and its outline."""
    edges = []
    for i, (simplex, neighbours) in enumerate(zip(hull.simplices, hull.neighbors, strict=True)):
        for k, j in enumerate(neighbours):
            here, there = hull.equations[i, :3], hull.equations[j, :3]
            if i > j or (here[2] <= FLAT and there[2] <= FLAT):
                continue
            outline = min(here[2], there[2]) <= FLAT
            bend = here @ there
            if bend < SHARP or (outline and bend < 1.0 - FLAT):
                edges.append(corners[np.delete(simplex, k)])
    return np.array(edges).reshape(-1, 2, 3)


def _hidden_spans(starts: Floats, steps: Floats, planes: Floats) -> tuple[Floats, Floats]:
    """Where a solid hides the edges ``starts + s * steps`` (N, 3): s from, s to; from > to: not.

    Inside: a + b s + c t <= 0 for every plane, t > 0 towards the viewer.
    """
    a = starts @ planes[:, :3].T + planes[:, 3] + SHRINK_MM
    b = steps @ planes[:, :3].T
    c = planes[:, 2]
    upper, lower, level = c > FLAT, c < -FLAT, np.abs(c) <= FLAT
    # t <= -(a + b s)/c above, t >= the same below; and t >= 0: rows (offset, slope) of the bounds.
    top = [-a[:, upper] / c[upper], -b[:, upper] / c[upper]]
    zero = np.zeros((len(starts), 1))
    bottom = [
        np.hstack([-a[:, lower] / c[lower], zero]),
        np.hstack([-b[:, lower] / c[lower], zero]),
    ]
    offset = (bottom[0][:, :, None] - top[0][:, None, :]).reshape(len(starts), -1)
    slope = (bottom[1][:, :, None] - top[1][:, None, :]).reshape(len(starts), -1)
    offset, slope = np.hstack([offset, a[:, level]]), np.hstack([slope, b[:, level]])
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = -offset / slope
    rising, falling = slope > FLAT, slope < -FLAT
    last = np.where(rising, crossing, np.inf).min(axis=1, initial=1.0)
    first = np.where(falling, crossing, -np.inf).max(axis=1, initial=0.0)
    never = (~rising & ~falling & (offset > 0.0)).any(axis=1)
    return np.where(never, 1.0, first), np.where(never, 0.0, last)


def visible_lines(solids_mm: Sequence[Floats], axes: Floats) -> list[Floats]:
    """For each solid (K, 3) the visible parts of its edges (M, 2, 2) in the view, millimetres.

    ``axes`` (3, 3): rows right, up and towards the viewer, in the rig frame.
    """
    solids = [_Solid(corners @ axes.T) for corners in solids_mm]
    owners = np.repeat(np.arange(len(solids), dtype=np.int64), [len(s.edges) for s in solids])
    edges = np.concatenate([s.edges for s in solids]) if solids else np.zeros((0, 2, 3))
    spans = _spans(solids, edges, owners)
    out: list[list[Floats]] = [[] for _ in solids]
    for edge, owner, hidden in zip(edges, owners, spans, strict=True):
        start, step = edge[0, :2], edge[1, :2] - edge[0, :2]
        length = float(np.linalg.norm(step))
        for low, high in _gaps(hidden):
            if (high - low) * length > SHORTEST_MM:
                out[owner].append(np.array([start + low * step, start + high * step]))
    return [np.array(found).reshape(-1, 2, 2) for found in out]


def _spans(solids: list[_Solid], edges: Floats, owners: Ints) -> list[list[tuple[float, float]]]:
    """For each edge the intervals that some solid hides."""
    spans: list[list[tuple[float, float]]] = [[] for _ in edges]
    low, high = edges.min(axis=1), edges.max(axis=1)
    for index, solid in enumerate(solids):
        across = (low[:, :2] < solid.high[:2]) & (high[:, :2] > solid.low[:2])
        near = across.all(axis=1) & (low[:, 2] < solid.high[2]) & (owners != index)
        rows = np.flatnonzero(near)
        if not len(rows):
            continue
        starts = edges[rows, 0]
        first, last = _hidden_spans(starts, edges[rows, 1] - starts, solid.planes)
        for row, begin, end in zip(rows, first, last, strict=True):
            if begin < end:
                spans[row].append((float(begin), float(end)))
    return spans


def _gaps(hidden: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """What of 0 to 1 no interval covers."""
    gaps, at = [], 0.0
    for begin, end in sorted(hidden):
        if begin > at:
            gaps.append((at, begin))
        at = max(at, end)
    return [*gaps, (at, 1.0)] if at < 1.0 else gaps
