"""Which camera sees which point: facing and free line of sight, by ray casting on the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from geometry.raycast import Occluder
from geometry.surface import SurfacePoints
from solver.motion import HeadPosition


@dataclass(frozen=True, eq=False)
class Visibility:
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
    return cosines_of(points.points_mm, points.normals, eye_mm)


def cosines_of(points_mm: Floats, normals: Floats, eyes_mm: Floats) -> Floats:
    """Cosine (p,) of the angle between normals (p, 3) and the rays to eyes (3,) or (p, 3)."""
    ray = eyes_mm - points_mm
    return np.asarray(np.einsum("pk,pk->p", normals, ray) / np.linalg.norm(ray, axis=1))


def cast_rays(
    points: SurfacePoints,
    occluder: Occluder,
    centres_mm: Floats,
    ray_max_deg: float,
    positions: tuple[HeadPosition, ...],
) -> Visibility:
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
    return Visibility(facing, facing & free, worst)


@dataclass(frozen=True, eq=False)
class TangentPlanes:
    """Planes over which a camera must rise to see a point: ``normal . (C - point) >= 0``.

    ``point_mm``, ``normal`` (m, 3); ``swing_deg`` (m,) the angle to rise by, infinite where the
    point is hidden even from the direction in which it was hoped to be visible.
    """

    point_mm: Floats
    normal: Floats
    deficit_deg: Floats


def tangent_planes(
    points: SurfacePoints, occluder: Occluder, rows: Ints, eyes_mm: Floats, open_mm: Floats
) -> TangentPlanes:
    """Tangent planes of what hides points ``rows`` (m,) from ``eyes_mm`` (m, 3).

    ``open_mm`` (m, 3) are directions in which each point is known to be visible, or likely to
    be. The limit of visibility between the two directions is bisected by ray casting; there
    the ray grazes the occluder, whose tangent plane is the cut.
    """
    at, normal = points.points_mm[rows], points.normals[rows]
    start = at + occluder.lift_mm * normal
    hidden_ray = _unit(eyes_mm - start)
    open_ray, first_ray = _unit(open_mm), hidden_ray
    lost = occluder.first_hits(start, open_ray)[0] >= 0
    graze = np.zeros_like(at)
    for _ in range(14):
        middle = _unit(hidden_ray + open_ray)
        triangle, _ = occluder.first_hits(start, middle)
        blocked = triangle >= 0
        graze[blocked] = occluder.face_normals(triangle[blocked])
        hidden_ray = np.where(blocked[:, None], middle, hidden_ray)
        open_ray = np.where(blocked[:, None], open_ray, middle)
    plane = graze - np.einsum("rk,rk->r", graze, open_ray)[:, None] * open_ray
    arc = open_ray - np.einsum("rk,rk->r", open_ray, hidden_ray)[:, None] * hidden_ray
    poor = np.linalg.norm(plane, axis=1) < 0.3
    plane[poor] = arc[poor]
    plane *= np.where(np.einsum("rk,rk->r", plane, arc) < 0.0, -1.0, 1.0)[:, None]
    swing = np.degrees(np.arccos(np.clip(np.einsum("rk,rk->r", open_ray, first_ray), -1.0, 1.0)))
    return TangentPlanes(at, _unit(plane), np.where(lost, np.inf, swing))


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12))
