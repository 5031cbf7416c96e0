"""Which camera sees which point: facing and free line of sight, by ray casting on the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from geometry.raycast import Occluder
from geometry.surface import SurfacePoints
from solver.motion import HeadPosition


@dataclass(frozen=True, eq=False)
class Sight:
    """``facing`` and ``free`` (n, p): within the limit of incidence; nothing in the way.

    ``cosine`` (n, p) of the angle of incidence at its worst. With several head positions a ray
    counts only when it holds in all of them. Rays that do not face are not cast: ``free`` is
    then False.
    """

    facing: Bools
    free: Bools
    cosine: Floats

    @property
    def seen(self) -> Bools:
        """Facing and free, (n, p)."""
        return np.asarray(self.facing & self.free)


def cosines(points: SurfacePoints, eye_mm: Floats) -> Floats:
    """Cosine of the angle between each point's normal and the ray to the eye, (p,)."""
    way = eye_mm - points.points_mm
    return np.asarray(np.einsum("pk,pk->p", points.normals, way) / np.linalg.norm(way, axis=1))


def sight(
    points: SurfacePoints,
    occluder: Occluder,
    centres_mm: Floats,
    ray_max_deg: float,
    positions: tuple[HeadPosition, ...],
) -> Sight:
    """Sight of ``points`` (p) from ``centres_mm`` (n, 3) in every one of the head positions."""
    n, p = len(centres_mm), len(points)
    limit = np.cos(np.radians(ray_max_deg))
    facing, free = np.ones((n, p), bool), np.ones((n, p), bool)
    worst = np.ones((n, p))
    for position in positions:
        for i, centre in enumerate(centres_mm):
            eye = position.eye_seen_by_head(centre)
            cosine = cosines(points, eye)
            worst[i] = np.minimum(worst[i], cosine)
            facing[i] &= cosine >= limit
            cast = np.flatnonzero(facing[i] & free[i])
            free[i, cast] = ~occluder.hidden(points.points_mm[cast], points.normals[cast], eye)
    return Sight(facing, facing & free, worst)


@dataclass(frozen=True, eq=False)
class Horizons:
    """Planes over which a camera must rise to see a point: ``normal . (C - point) >= 0``.

    ``point_mm``, ``normal`` (m, 3); ``swing_deg`` (m,) the angle to rise by, infinite where the
    point is hidden even from the direction in which it was hoped to be visible.
    """

    point_mm: Floats
    normal: Floats
    swing_deg: Floats


def horizons(
    points: SurfacePoints, occluder: Occluder, rows: Ints, eyes_mm: Floats, open_mm: Floats
) -> Horizons:
    """Tangent planes of what hides points ``rows`` (m,) from ``eyes_mm`` (m, 3).

    ``open_mm`` (m, 3) are directions in which each point is known to be visible, or likely to
    be. The limit of visibility between the two directions is bisected by ray casting; there
    the ray grazes the occluder, whose tangent plane is the horizon.
    """
    at, normal = points.points_mm[rows], points.normals[rows]
    start = at + occluder.lift_mm * normal
    hidden_way = _unit(eyes_mm - start)
    open_way, first_way = _unit(open_mm), hidden_way
    lost = occluder.first_hits(start, open_way)[0] >= 0
    graze = np.zeros_like(at)
    for _ in range(14):
        middle = _unit(hidden_way + open_way)
        triangle, _ = occluder.first_hits(start, middle)
        blocked = triangle >= 0
        graze[blocked] = occluder.face_normals(triangle[blocked])
        hidden_way = np.where(blocked[:, None], middle, hidden_way)
        open_way = np.where(blocked[:, None], open_way, middle)
    plane = graze - np.einsum("rk,rk->r", graze, open_way)[:, None] * open_way
    arc = open_way - np.einsum("rk,rk->r", open_way, hidden_way)[:, None] * hidden_way
    poor = np.linalg.norm(plane, axis=1) < 0.3
    plane[poor] = arc[poor]
    plane *= np.where(np.einsum("rk,rk->r", plane, arc) < 0.0, -1.0, 1.0)[:, None]
    swing = np.degrees(np.arccos(np.clip(np.einsum("rk,rk->r", open_way, first_way), -1.0, 1.0)))
    return Horizons(at, _unit(plane), np.where(lost, np.inf, swing))


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12))
