"""The depth map of one reference camera: coarse pairs first, then patches over all views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from evaluation.reconstruction.stereo import coarse_inverse_depth
from evaluation.reconstruction.views import Singles, View
from evaluation.reconstruction.volume import Volume
from geometry.arrays import Bools, Floats


@dataclass(frozen=True)
class Matching:
    """How patches are matched.

    ``half_width_samples`` to each side of a patch's middle; ``stride_px`` between the middles;
    ``steps`` Gauss-Newton steps at most; ``least_correlation`` below which a view is dropped.
    """

    half_width_samples: int = 6
    stride_px: int = 2
    steps: int = 5
    least_correlation: float = 0.8


@dataclass(frozen=True, eq=False)
class DepthMap:
    """What one reference camera measured on a grid of its pixels, each (h, w), NaN where nothing.

    ``inverse_depth_per_mm`` along the camera's axis at pixels ``stride * (column, row)`` with its
    ``variance`` (1/mm2) and slopes per pixel (h, w, 2); ``correlation`` mean over the views used,
    ``views`` how many they are, the reference not counted.
    """

    reference: View
    stride_px: int
    inverse_depth_per_mm: Floats
    slopes: Floats
    variance: Floats
    correlation: Singles
    views: NDArray[np.int8]


def coarse_start(reference: View, partners: Sequence[View], volume: Volume) -> Singles:
    """Inverse depth from pairs: the first partner's where it knows, then the next one's."""
    out: Singles | None = None
    for partner in partners:
        found = coarse_inverse_depth(reference, partner, volume)
        out = found if out is None else np.where(np.isfinite(out), out, found)
    if out is None:
        return np.full(reference.grey.shape, np.nan, dtype=np.float32)
    return out


def relations(reference: View, others: Sequence[View]) -> tuple[Floats, Floats]:
    """``M`` (K, 3, 3) and ``m`` (K, 3) of the kernel's formula for each other view."""
    back = reference.pose.rotation_rig_to_camera.T @ np.linalg.inv(reference.matrix)
    turn = [v.matrix @ v.pose.rotation_rig_to_camera for v in others]
    base = [reference.pose.position_rig_mm - v.pose.position_rig_mm for v in others]
    return np.array([t @ back for t in turn]), np.array(
        [t @ b for t, b in zip(turn, base, strict=True)]
    )


def refined(
    reference: View,
    others: Sequence[View],
    start: Floats,
    slopes: Floats,
    stride_px: int,
    matching: Matching,
) -> DepthMap:
    """Patches at every ``stride_px`` pixels where ``start`` (h, w) knows an inverse depth.

    ``slopes`` (h, w, 2) change of the inverse depth per pixel along columns and rows.
    """
    height, width = start.shape
    known = np.isfinite(start)
    rows, columns = np.nonzero(known)
    pixels = np.stack([columns, rows], axis=1).astype(np.int64) * stride_px
    found = matched(reference, others, pixels, start[known], slopes[known], matching)
    full = np.full((height, width, found.shape[1]), np.nan)
    full[known] = found
    return DepthMap(
        reference,
        stride_px,
        full[..., 0],
        full[..., 1:3],
        full[..., 3],
        full[..., 4].astype(np.float32),
        np.nan_to_num(full[..., 5], nan=0.0).astype(np.int8),
    )


def matched(
    reference: View,
    others: Sequence[View],
    pixels: NDArray[np.int64],
    rho: Floats,
    slopes: Floats,
    matching: Matching,
) -> Floats:
    """Patches about ``pixels`` (N, 2), column and row, from the planes ``rho``, ``slopes`` (N, 2).

    Returns the kernel's fields (N, FIELDS), NaN where nothing matched.
    """
    from evaluation.reconstruction.kernel import FIELDS, refine

    reach = matching.half_width_samples
    width, height = reference.size_px
    far = pixels < [width - reach, height - reach]
    inside = np.asarray((pixels >= reach).all(axis=1) & far.all(axis=1))
    inside[inside] = ~reference.clipped[pixels[inside, 1], pixels[inside, 0]]
    matrices, shifts = relations(reference, others)
    fields = np.full((len(pixels), FIELDS), np.nan)
    fields[inside] = refine(
        reference.grey,
        np.stack([v.grey for v in others]),
        matrices,
        shifts,
        pixels[inside],
        np.column_stack([rho, slopes])[inside].astype(np.float64),
        reach,
        1,
        matching.steps,
        matching.least_correlation,
    )
    good = inside & (fields[:, 3] > 0.0) & (fields[:, 5] >= 1.0) & (fields[:, 6] < 0.5)
    fields[~good] = np.nan
    return fields


def first_slopes(inverse_depth_per_mm: Floats, spacing_px: float) -> tuple[Floats, Floats]:
    """A smoothed inverse depth (h, w) and its slopes per pixel (h, w, 2), gaps kept as NaN."""
    known = np.isfinite(inverse_depth_per_mm)
    weight = ndimage.gaussian_filter(known.astype(np.float64), 1.5)
    filled = ndimage.gaussian_filter(np.where(known, inverse_depth_per_mm, 0.0), 1.5)
    smooth = np.where(known, filled / np.maximum(weight, 1e-9), np.nan)
    dy, dx = np.gradient(smooth, spacing_px)
    slopes = np.nan_to_num(np.stack([dx, dy], axis=-1))
    return smooth, slopes


def steady(map_: DepthMap, tolerance_px: float, scale_px_mm: float) -> Bools:
    """Where a patch agrees with the median of its neighbours, (h, w).

    ``scale_px_mm`` turns inverse depth into pixels of the widest partner (focal length times
    base). A lone patch that went elsewhere is a blunder; a surface is not.
    """
    known = np.isfinite(map_.inverse_depth_per_mm)
    value = np.where(known, map_.inverse_depth_per_mm, 0.0).astype(np.float32)
    middle = cv2.medianBlur(value, 5)
    return np.asarray(known & (np.abs(value - middle) * scale_px_mm <= tolerance_px))


def grown_start(map_: DepthMap, steps: int) -> tuple[Floats, Floats]:
    """Start values for the gaps of a map: the plane of the nearest patch within ``steps``.

    NaN where there is a patch already or none is near.
    """
    known = np.isfinite(map_.inverse_depth_per_mm)
    distance, (iy, ix) = ndimage.distance_transform_edt(~known, return_indices=True)
    rows, columns = np.indices(known.shape)
    slope = map_.slopes[iy, ix]
    value = (
        map_.inverse_depth_per_mm[iy, ix]
        + slope[..., 0] * (columns - ix) * map_.stride_px
        + slope[..., 1] * (rows - iy) * map_.stride_px
    )
    near = ~known & (distance <= steps)
    return np.where(near, value, np.nan), slope


_BEND_CELLS = 3.0
"""Curvature is taken over so many grid cells: less is noisier than what it mends (measured)."""


def bend(map_: DepthMap, half_width_px: int) -> Floats:
    """By how much the curvature, which a plane cannot follow, lifts the patches of a map, (h, w).

    A plane fitted over ``-h..h`` pixels to a surface whose inverse depth bends by ``c`` and ``e``
    per pixel squared lies off its middle by ``(c + e) / 2`` times the mean of ``i^2``, which is
    ``h (h + 1) / 3``. The bends are the change of the slopes from patch to patch. 0 where a
    neighbour is missing.
    """
    known = np.isfinite(map_.inverse_depth_per_mm)
    weight = np.maximum(ndimage.gaussian_filter(known.astype(np.float64), _BEND_CELLS), 1e-9)
    total = np.zeros(known.shape)
    for number, axis in ((0, 1), (1, 0)):
        slope = np.where(known, map_.slopes[..., number], 0.0)
        smooth = ndimage.gaussian_filter(slope, _BEND_CELLS) / weight
        total += np.gradient(smooth, map_.stride_px, axis=axis)
    # At a rim the slopes of nothing would speak too.
    inner = ndimage.minimum_filter(known, 3)
    return np.where(inner, total * half_width_px * (half_width_px + 1) / 6.0, 0.0)


def bent(map_: DepthMap, half_width_px: int) -> DepthMap:
    """The map with its patches' curvature taken out."""
    rho = map_.inverse_depth_per_mm - bend(map_, half_width_px)
    return replace(map_, inverse_depth_per_mm=rho)


def facing(map_: DepthMap, steepest_deg: float) -> Bools:
    """Which patches (h, w) their camera sees at no more than that from the normal.

    At 70 degrees one reaches over three times as much of the surface as others: it is no plane.
    """
    view = map_.reference
    rows, columns = np.indices(map_.inverse_depth_per_mm.shape) * float(map_.stride_px)
    rho, slope = map_.inverse_depth_per_mm, map_.slopes
    flat = rho - slope[..., 0] * columns - slope[..., 1] * rows
    plane = np.stack([slope[..., 0], slope[..., 1], flat], axis=-1) @ view.matrix
    rays = np.stack([columns, rows, np.ones_like(rows)], axis=-1) @ np.linalg.inv(view.matrix).T
    least = np.cos(np.radians(steepest_deg))
    length = np.linalg.norm(plane, axis=-1) * np.linalg.norm(rays, axis=-1)
    with np.errstate(invalid="ignore"):
        return np.asarray(rho >= least * length)


def merged(map_: DepthMap, more: DepthMap) -> DepthMap:
    """Both maps of one reference: the first where it knows, else the second."""
    known = np.isfinite(map_.inverse_depth_per_mm)
    return replace(
        map_,
        inverse_depth_per_mm=np.where(known, map_.inverse_depth_per_mm, more.inverse_depth_per_mm),
        slopes=np.where(known[..., None], map_.slopes, more.slopes),
        variance=np.where(known, map_.variance, more.variance),
        correlation=np.where(known, map_.correlation, more.correlation),
        views=np.where(known, map_.views, more.views).astype(np.int8),
    )


def upsampled(
    map_: DepthMap, keep: Bools, shape: tuple[int, int], stride_px: int
) -> tuple[Floats, Floats]:
    """Start values for the next level from the planes of this one.

    The next level has twice the resolution: pixel u here is 2 u + 0.5 there. Each new patch
    starts on the plane of the nearest kept one within two grid steps.
    """
    h, w = shape
    rows, columns = np.mgrid[0:h, 0:w] * float(stride_px)
    u, v = (columns - 0.5) / 2.0, (rows - 0.5) / 2.0
    distance, (iy, ix) = ndimage.distance_transform_edt(~keep, return_indices=True)
    gy = np.clip(np.rint(v / map_.stride_px).astype(int), 0, keep.shape[0] - 1)
    gx = np.clip(np.rint(u / map_.stride_px).astype(int), 0, keep.shape[1] - 1)
    ny, nx = iy[gy, gx], ix[gy, gx]
    near = distance[gy, gx] <= 2.0
    slope = map_.slopes[ny, nx]
    value = (
        map_.inverse_depth_per_mm[ny, nx]
        + slope[..., 0] * (u - nx * map_.stride_px)
        + slope[..., 1] * (v - ny * map_.stride_px)
    )
    return np.where(near, value, np.nan), slope / 2.0


def masked(map_: DepthMap, keep: Bools) -> DepthMap:
    """The same map with NaN where ``keep`` is false."""
    return replace(
        map_,
        inverse_depth_per_mm=np.where(keep, map_.inverse_depth_per_mm, np.nan),
        variance=np.where(keep, map_.variance, np.nan),
        views=np.where(keep, map_.views, 0).astype(np.int8),
    )
