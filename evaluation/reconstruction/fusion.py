"""From depth maps to one cloud: what two references agree on, each point once and at its best.

Each piece of surface is measured in the references that see it best only; a point stays when
another reference measures the same surface, or when several views of its own agree and nobody
contradicts it. What it says is averaged with what the others say, along its normal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evaluation.reconstruction.depthmaps import DepthMap
from geometry.arrays import Bools, Floats

AGREE_MM = 0.5
"""Two measurements of one surface differ by less; those of two surfaces hardly ever do."""

ALONE_VIEWS = 2
"""Views besides the reference that a point needs which no other reference confirms."""


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """Points of one depth map: where, how they face, how sure, from how many cameras.

    ``points_mm``, ``normals`` (N, 3) in the rig frame, normals towards the camera; ``sigma_mm``
    (N,) along the normal; ``views`` (N,) cameras; ``columns`` and ``rows`` (N,) of the grid.
    """

    points_mm: Floats
    normals: Floats
    sigma_mm: Floats
    views: NDArray[np.int8]
    columns: NDArray[np.int64]
    rows: NDArray[np.int64]
    resolution: Floats


def measured_points(map_: DepthMap) -> MeasuredPoints:
    """All points of a depth map in the rig frame.

    The plane ``rho (u, v)`` of a patch is ``n . X = 1`` in the camera frame with
    ``n = K' (a, b, rho - a u - b v)``: so its normal is exact too. ``resolution`` (N,) is the
    pixels that a square millimetre of the surface fills.
    """
    rows, columns = np.nonzero(np.isfinite(map_.inverse_depth_per_mm))
    rho = map_.inverse_depth_per_mm[rows, columns]
    slope = map_.slopes[rows, columns]
    view = map_.reference
    u, v = columns * float(map_.stride_px), rows * float(map_.stride_px)
    rays = np.column_stack([u, v, np.ones_like(u)]) @ np.linalg.inv(view.matrix).T
    turn = view.pose.rotation_rig_to_camera
    points = (rays / rho[:, None]) @ turn + view.pose.position_rig_mm
    plane = np.column_stack([slope, rho - slope[:, 0] * u - slope[:, 1] * v]) @ view.matrix
    normals = -plane / np.linalg.norm(plane, axis=1, keepdims=True)
    lengths = np.linalg.norm(rays, axis=1)
    cosine = -np.einsum("ij,ij->i", normals, rays) / lengths
    # A step of the inverse depth moves the point along its ray; the normal takes its share.
    sigma = np.sqrt(map_.variance[rows, columns]) / rho**2 * lengths * cosine
    resolution = view.matrix[0, 0] ** 2 * rho**2 * np.maximum(cosine, 0.0)
    return MeasuredPoints(
        points, normals @ turn, sigma, map_.views[rows, columns], columns, rows, resolution
    )


def _seen_in(map_: DepthMap, points: MeasuredPoints) -> tuple[Bools, Floats, Floats, Floats]:
    """How another reference measures the surface at the given points.

    Whether it does (N,), how far its surface lies along the point's normal (N,), mm, how far
    the point stands in front of it along its own ray (N,), mm, and its variance (N,), mm2.
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
    rays = local / np.where(depth > 0, depth, 1.0)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        ahead = np.where(known, 1.0 / rho - depth, np.nan)
    cosine = -np.einsum("ij,ij->i", points.normals @ view.pose.rotation_rig_to_camera.T, rays)
    with np.errstate(invalid="ignore", divide="ignore"):
        variance = map_.variance[iy, ix] / rho**4 * cosine**2
    return known, -ahead * cosine, ahead, variance


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
            view = other.reference
            rays = mine.points_mm - view.pose.position_rig_mm
            distance = np.linalg.norm(rays, axis=1)
            cosine = -np.einsum("ij,ij->i", mine.normals, rays) / distance
            theirs = view.matrix[0, 0] ** 2 / distance**2 * np.maximum(cosine, 0.0)
            better += known & (np.abs(along) < 4.0 * AGREE_MM) & (theirs > mine.resolution)
        mask = np.zeros(map_.inverse_depth_per_mm.shape, dtype=bool)
        mask[mine.rows, mine.columns] = better < most
        keep.append(mask)
    return keep


@dataclass(frozen=True, eq=False)
class FusedPoints:
    """What is left of one reference's points after the others were heard."""

    points_mm: Floats
    normals: Floats
    sigma_mm: Floats
    views: NDArray[np.int64]
    columns: NDArray[np.int64]
    rows: NDArray[np.int64]

    def subset(self, keep: Bools) -> FusedPoints:
        """The points of a mask (N,)."""
        return FusedPoints(
            self.points_mm[keep],
            self.normals[keep],
            self.sigma_mm[keep],
            self.views[keep],
            self.columns[keep],
            self.rows[keep],
        )


def fused(maps: Sequence[DepthMap], number: int) -> FusedPoints:
    """The points of map ``number`` that hold, each averaged with what other maps say of it."""
    mine = measured_points(maps[number])
    count = len(mine.points_mm)
    weight = 1.0 / np.maximum(mine.sigma_mm**2, 1e-12)
    total, shift = weight.copy(), np.zeros(count)
    support = np.zeros(count, dtype=np.int64)
    against = np.zeros(count, dtype=np.int64)
    for other_number, other in enumerate(maps):
        if other_number == number:
            continue
        known, along, ahead, variance = _seen_in(other, mine)
        agree = known & (np.abs(along) < AGREE_MM)
        w = np.where(agree, 1.0 / np.maximum(variance, 1e-12), 0.0)
        shift += np.where(agree, w * along, 0.0)
        total += w
        support += agree
        # It sees a surface well behind this point: the point would stand in its way.
        against += known & (ahead > 4.0 * AGREE_MM)
    keep = (support > against) | ((support == 0) & (against == 0) & (mine.views >= ALONE_VIEWS))
    keep &= mine.sigma_mm > 0.0
    moved = mine.points_mm + (shift / total)[:, None] * mine.normals
    # The maps share pictures, so their mean is hardly surer than the best of them.
    sigma = np.sqrt(1.0 / total * np.minimum(1.0 + support, 2.0))
    return FusedPoints(
        moved[keep],
        mine.normals[keep],
        sigma[keep],
        (1 + mine.views.astype(np.int64) + support)[keep],
        mine.columns[keep],
        mine.rows[keep],
    )
