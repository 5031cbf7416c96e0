"""From depth maps to one cloud: what two references agree on, each point once and at its best.

Each piece of surface is measured in the references that see it best only; a point stays when
another reference measures the same surface: what one alone says has ten times the rms. It is
averaged with what the others say, along its normal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from evaluation.reconstruction.depthmaps import DepthMap
from evaluation.reconstruction.views import Bytes
from geometry.arrays import Bools, Floats

AGREE_MM = 0.5
"""Two measurements of one surface differ by less; those of two surfaces hardly ever do."""

ALIKE = np.cos(np.radians(40.0))
"""Two patches of one surface face the same way; at more than this angle one of them errs."""

FEWEST_DIFFERENCES = 100
"""Fewer tell their spread to no better than a tenth."""

_CUBE_MM = 15.0

SHARED = 0.4
"""Correlation of what two references say of one place: they match pictures that are partly the
same. Measured: the mean of three is 1.29 times surer than one, 1.73 would be independence."""


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """Points of one reference: where, how they face, how sure, from how many cameras.

    ``points_mm``, ``normals`` (N, 3) in the rig frame, normals towards the camera; ``sigma_mm``
    (N,) along the normal; ``views`` (N,) cameras; ``pixels`` (N, 2) column and row; ``per_mm2``
    (N,) cells of the map's grid that a square millimetre of the surface fills.
    """

    points_mm: Floats
    normals: Floats
    sigma_mm: Floats
    views: NDArray[np.int8]
    pixels: NDArray[np.int64]
    per_mm2: Floats

    def subset(self, keep: Bools) -> MeasuredPoints:
        """The points of a mask (N,)."""
        return MeasuredPoints(*(getattr(self, f.name)[keep] for f in fields(self)))


def measured_points(map_: DepthMap) -> MeasuredPoints:
    """All points of a depth map in the rig frame."""
    rows, columns = np.nonzero(np.isfinite(map_.inverse_depth_per_mm))
    return points_of(
        map_,
        np.column_stack([columns, rows]) * map_.stride_px,
        map_.inverse_depth_per_mm[rows, columns],
        map_.slopes[rows, columns],
        map_.variance[rows, columns],
        map_.views[rows, columns],
    )


def points_of(
    map_: DepthMap,
    pixels: NDArray[np.int64],
    rho: Floats,
    slopes: Floats,
    variance: Floats,
    views: NDArray[np.int8],
) -> MeasuredPoints:
    """Patches at ``pixels`` (N, 2) of a map's reference as points in the rig frame.

    The plane ``rho (u, v)`` of a patch is ``n . X = 1`` in the camera frame with
    ``n = K' (a, b, rho - a u - b v)``: so its normal is exact too.
    """
    view = map_.reference
    rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(view.matrix).T
    turn = view.pose.rotation_rig_to_camera
    flat = rho - np.einsum("ij,ij->i", slopes, pixels)
    plane = np.column_stack([slopes, flat]) @ view.matrix
    normals = -plane / np.linalg.norm(plane, axis=1, keepdims=True)
    # A step of the inverse depth moves the point along its ray; the normal takes its share.
    across = -np.einsum("ij,ij->i", normals, rays)
    cosine = across / np.linalg.norm(rays, axis=1)
    points = (rays / rho[:, None]) @ turn + view.pose.position_rig_mm
    distance = np.linalg.norm(rays, axis=1) / rho
    return MeasuredPoints(
        points,
        normals @ turn,
        np.sqrt(variance) / rho**2 * across,
        views,
        pixels,
        _cells_per_mm2(map_, distance, cosine),
    )


def _cells_per_mm2(map_: DepthMap, distance_mm: Floats, cosine: Floats) -> Floats:
    focal = map_.reference.matrix[0, 0] / map_.stride_px
    return np.asarray(focal**2 / distance_mm**2 * np.maximum(cosine, 0.0))


def _per_mm2(map_: DepthMap, points: MeasuredPoints) -> Floats:
    """Cells of a map's grid that a square millimetre of the surface at each point fills, (N,)."""
    rays = points.points_mm - map_.reference.pose.position_rig_mm
    distance = np.linalg.norm(rays, axis=1)
    cosine = -np.einsum("ij,ij->i", points.normals, rays) / distance
    return _cells_per_mm2(map_, distance, cosine)


def _seen_in(map_: DepthMap, points: MeasuredPoints) -> tuple[Bools, Floats, Floats, Floats]:
    """How another reference measures the surface at the given points.

    Whether it does (N,), how far its plane lies along its normal (N,), mm (NaN where it faces
    another way), how far the point stands in front of it along its own ray (N,), mm, and its
    variance along its normal (N,), mm2. Along the ray it would be worth nothing: a camera that
    sees a surface edgewise knows little about it.
    """
    view = map_.reference
    local = (points.points_mm - view.pose.position_rig_mm) @ view.pose.rotation_rig_to_camera.T
    depth = local[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        pixel = (local / depth[:, None]) @ view.matrix.T
    grid_h, grid_w = map_.inverse_depth_per_mm.shape
    gx = np.nan_to_num(np.rint(pixel[:, 0] / map_.stride_px), nan=-1.0, posinf=-1.0, neginf=-1.0)
    gy = np.nan_to_num(np.rint(pixel[:, 1] / map_.stride_px), nan=-1.0, posinf=-1.0, neginf=-1.0)
    inside = (depth > 0) & (gx >= 0) & (gy >= 0) & (gx < grid_w) & (gy < grid_h)
    ix, iy = np.where(inside, gx, 0).astype(np.int64), np.where(inside, gy, 0).astype(np.int64)
    slope = map_.slopes[iy, ix]
    rho = (
        map_.inverse_depth_per_mm[iy, ix]
        + slope[:, 0] * (pixel[:, 0] - ix * map_.stride_px)
        + slope[:, 1] * (pixel[:, 1] - iy * map_.stride_px)
    )
    known = inside & np.isfinite(rho) & (rho > 0)
    # The other's plane: n . X = 1 in its camera's frame.
    plane = np.column_stack([slope, rho - slope[:, 0] * pixel[:, 0] - slope[:, 1] * pixel[:, 1]])
    plane = plane @ view.matrix
    steep = np.linalg.norm(plane, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (np.einsum("ij,ij->i", plane, local) - 1.0) / steep
        ahead = np.where(known, 1.0 / rho - depth, np.nan)
        same = -np.einsum("ij,ij->i", points.normals @ view.pose.rotation_rig_to_camera.T, plane)
        variance = map_.variance[iy, ix] / (rho * steep) ** 2
    alike = known & (same >= ALIKE * steep)
    return known, np.where(alike, along, np.nan), ahead, variance


def best_references(maps: Sequence[DepthMap], most: int) -> list[Bools]:
    """For each map which of its points it is among the ``most`` best references of, (h, w) each.

    Best is who sees the surface with most pixels to the square millimetre.
    """
    found = [measured_points(m) for m in maps]
    keep = []
    for number, (map_, mine) in enumerate(zip(maps, found, strict=True)):
        better = np.zeros(len(mine.points_mm), dtype=np.int64)
        for other_number, other in enumerate(maps):
            if other_number == number:
                continue
            known, along, _, _ = _seen_in(other, mine)
            theirs = _per_mm2(other, mine)
            better += known & (np.abs(along) < 4.0 * AGREE_MM) & (theirs > mine.per_mm2)
        mask = np.zeros(map_.inverse_depth_per_mm.shape, dtype=bool)
        columns, rows = mine.pixels.T // map_.stride_px
        mask[rows, columns] = better < most
        keep.append(mask)
    return keep


@dataclass(frozen=True, eq=False)
class FusedPoints:
    """What is left of one reference's points after the others were heard.

    ``apart`` (N,): how far the surface of the surest other reference lies off, in standard
    deviations of the difference as the two predict it; NaN where none measured it. ``per_mm2``
    (N,): points that all references together have for a square millimetre there. ``colours``
    (N, 3) as the reference shows them.
    """

    points_mm: Floats
    normals: Floats
    sigma_mm: Floats
    views: NDArray[np.int64]
    pixels: NDArray[np.int64]
    apart: Floats
    per_mm2: Floats
    colours: Bytes

    def subset(self, keep: Bools) -> FusedPoints:
        """The points of a mask (N,)."""
        return FusedPoints(*(getattr(self, f.name)[keep] for f in fields(self)))


def joined(parts: Sequence[FusedPoints]) -> FusedPoints:
    """All points of all parts (one at least), in their order."""
    return FusedPoints(
        *(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(FusedPoints))
    )


def fused(maps: Sequence[DepthMap], number: int, mine: MeasuredPoints | None = None) -> FusedPoints:
    """The points of map ``number`` that hold, each averaged with what other maps say of it.

    ``mine``: other points of the same reference instead.
    """
    mine = measured_points(maps[number]) if mine is None else mine
    count = len(mine.points_mm)
    weight = 1.0 / np.maximum(mine.sigma_mm**2, 1e-12)
    total, shift = weight.copy(), np.zeros(count)
    support = np.zeros(count, dtype=np.int64)
    against = np.zeros(count, dtype=np.int64)
    apart, least = np.full(count, np.nan), np.full(count, np.inf)
    per_mm2 = mine.per_mm2.copy()
    for other_number, other in enumerate(maps):
        if other_number == number:
            continue
        known, along, ahead, variance = _seen_in(other, mine)
        agree = known & (np.abs(along) < AGREE_MM)
        w = np.where(agree, 1.0 / np.maximum(variance, 1e-12), 0.0)
        shift += np.where(agree, w * along, 0.0)
        total += w
        support += agree
        per_mm2 += np.where(agree, _per_mm2(other, mine), 0.0)
        surer = agree & (variance < least)
        both = np.sqrt(mine.sigma_mm**2 + variance)
        apart, least = np.where(surer, along / both, apart), np.where(surer, variance, least)
        # It sees a surface well behind this point: the point would stand in its way.
        against += known & (ahead > 4.0 * AGREE_MM)
    keep = (support > against) & (mine.sigma_mm > 0.0)
    moved = mine.points_mm + (shift / total)[:, None] * mine.normals
    # The maps share pictures: a mean of n, each correlated by r with each, has (1 + (n - 1) r) / n.
    sigma = np.sqrt((1.0 + SHARED * support) / total)
    columns, rows = mine.pixels[keep].T
    return FusedPoints(
        moved[keep],
        mine.normals[keep],
        sigma[keep],
        (1 + mine.views.astype(np.int64) + support)[keep],
        mine.pixels[keep],
        apart[keep],
        per_mm2[keep],
        maps[number].reference.colour[rows, columns],
    )


def boldness(points_mm: Floats, apart: Floats) -> Floats:
    """By how much the predicted sigma of each point (N,) is too small, at least 1.

    ``apart`` (N,) as of :class:`FusedPoints`: their robust spread should be 1. It is taken in
    cubes of 15 mm, because texture and form decide it, and where one has too few of all points.
    Two references share pictures, so their difference shows less than what each is off.
    """
    told = np.flatnonzero(np.isfinite(apart))
    if len(told) < FEWEST_DIFFERENCES:
        return np.ones(len(apart))
    seen = np.abs(apart[told]) * 1.4826 / np.sqrt(1.0 - SHARED)
    corner = np.floor((points_mm - points_mm.min(axis=0)) / _CUBE_MM).astype(np.int64)
    keys = corner @ np.array([1 << 40, 1 << 20, 1], dtype=np.int64)
    cubes, cube = np.unique(keys, return_inverse=True)
    count = np.bincount(cube[told], minlength=len(cubes))
    spread = ndimage.median(seen, cube[told], np.arange(len(cubes)))
    spread = np.where(count >= FEWEST_DIFFERENCES, spread, float(np.median(seen)))
    return np.asarray(np.maximum(spread, 1.0)[cube])
