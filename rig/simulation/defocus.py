"""Depth-of-field blur in layers of equal blur.

The blur disk of each pixel follows from its depth (thin lens, :mod:`geometry.optics`). Pixels are
shared out between layers of fixed blur, each layer is spread by the disk of its blur, and the
layers are added up; what they do not cover shows the backdrop, which has no detail to blur. On a
surface this is exact but for the shape of the disk between two layers; where a near thing hides a
far one of another blur (not the backdrop) light of the far one leaks over the edge by up to its
own blur radius, which real lenses do not do.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.optics import blur_disk_mm
from rig.simulation.imaging import SharpImage, fill_backdrop
from rig.simulation.tracing import SceneView

Singles = NDArray[np.float32]

LEAST_BLUR_PX = 0.3
"""Smaller disks are left out: their standard deviation is below a thirteenth of a pixel."""

_FINEST_STEP_PX = 0.7
_GROWTH = 1.3
_LARGEST_BLUR_PX = 250.0
_BAND_ROWS = 64
_SMALL_DISK_PX = 1.8
_LEAST_DEVIATION_PX = 0.05
_SMALL_DEVIATION_PX = 0.7
_CELLS = 16
"""Cells each way into which a pixel is cut to find how much of it a disk covers."""


def blur_px(depth_mm: Singles, rig_camera: RigCamera, f_number: float) -> Singles:
    """Diameter of the blur disk in pixels at each depth."""
    camera = rig_camera.camera
    disk = blur_disk_mm(
        depth_mm.astype(np.float64), rig_camera.focus_distance_mm, camera.focal_length_mm, f_number
    )
    return np.minimum(disk / camera.pixel_pitch_mm, _LARGEST_BLUR_PX).astype(np.float32)


def defocused(
    image: SharpImage, view: SceneView, table: Singles, rig_camera: RigCamera, f_number: float
) -> Singles:
    """Light on the sensor (H, W, C) of a lens of finite aperture."""
    seen = image.cover > 0.0
    blur = np.zeros_like(image.depth_mm)
    blur[seen] = blur_px(image.depth_mm[seen], rig_camera, f_number)
    largest = float(blur.max())
    out = image.radiance.copy()
    if largest < LEAST_BLUR_PX:
        return out
    pad = int(largest / 2.0) + 2
    box = _box(seen, pad)
    # Bands of some rows stay in the processor's cache, whole pictures do not.
    band = max(_BAND_ROWS, 2 * pad)
    for top in range(box[0].start, box[0].stop, band):
        rows = slice(top, min(top + band, box[0].stop))
        wide = slice(max(rows.start - pad, box[0].start), min(rows.stop + pad, box[0].stop))
        part = SharpImage(
            image.radiance[wide, box[1]], image.depth_mm[wide, box[1]], image.cover[wide, box[1]]
        )
        light = _spread(part, blur[wide, box[1]], view, table[wide, box[1]], pad)
        out[rows, box[1]] = light[rows.start - wide.start :][: rows.stop - rows.start]
    return out


def _spread(image: SharpImage, blur: Singles, view: SceneView, table: Singles, pad: int) -> Singles:
    """The light of one band, each pixel spread by its own blur."""
    if float(blur.max()) < LEAST_BLUR_PX:
        return image.radiance
    cover = image.cover
    # Deep within a surface nothing of the backdrop can come through, whatever the sums there.
    reach = np.ones((2 * pad + 1, 2 * pad + 1), dtype=np.uint8)
    border = cv2.dilate((cover < 1.0).view(np.uint8), reach).view(np.bool_)
    seen = cover > 0.0
    backdrop = fill_backdrop(image, view, table, border & seen)
    own = np.concatenate([image.radiance, cover[..., None]], axis=2)
    # Colour times cover, and cover, are what add up; the backdrop's share is taken out first.
    own[..., :-1] -= (1.0 - cover)[..., None] * backdrop
    total = np.zeros_like(own)
    square, nodes = blur * blur, _nodes(float(blur.max()))
    for number, node in enumerate(nodes):
        share = _share(square, nodes, number)
        share[~seen] = 0.0
        _add_layer(total, own, share, node)
    rest = (np.maximum(np.float32(1.0) - total[..., -1], 0.0) * border)[..., None]
    return np.asarray((total[..., :-1] + rest * backdrop) / (total[..., -1:] + rest))


def softened(light: Singles, deviation_px: float) -> Singles:
    """The light (H, W, C) after what even a perfectly focused lens blurs, a Gaussian."""
    if deviation_px < _LEAST_DEVIATION_PX:
        return light
    variance = deviation_px**2
    if deviation_px < _SMALL_DEVIATION_PX:
        # A Gaussian narrower than a pixel cannot be sampled; three weights can be as wide as it.
        side = np.array([variance / 2.0, 1.0 - variance, variance / 2.0])
    else:
        place = np.arange(-int(5.0 * deviation_px), int(5.0 * deviation_px) + 1)
        side = np.exp(-0.5 * place**2 / variance)
        side /= side.sum()
    soft = cv2.sepFilter2D(light, -1, side, side, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(soft, dtype=np.float32).reshape(light.shape)


def _box(where: NDArray[np.bool_], pad: int) -> tuple[slice, slice]:
    """The rows and columns that hold all true pixels, and ``pad`` more."""
    rows, columns = np.flatnonzero(where.any(axis=1)), np.flatnonzero(where.any(axis=0))
    return (
        slice(max(rows[0] - pad, 0), min(rows[-1] + pad + 1, where.shape[0])),
        slice(max(columns[0] - pad, 0), min(columns[-1] + pad + 1, where.shape[1])),
    )


def _nodes(largest: float) -> tuple[float, ...]:
    """Blurs of the layers: 0, then steps of 0.7 px, then of 30 %."""
    nodes = [0.0, _FINEST_STEP_PX]
    while nodes[-1] < largest:
        nodes.append(nodes[-1] + max(_FINEST_STEP_PX, (_GROWTH - 1.0) * nodes[-1]))
    return tuple(nodes)


def _share(square: Singles, nodes: tuple[float, ...], number: int) -> Singles:
    """How much of each pixel belongs to a layer: linear in the disk's variance between layers."""
    here = nodes[number] ** 2
    share = np.ones_like(square)
    if number > 0:
        below = nodes[number - 1] ** 2
        np.minimum(share, (square - np.float32(below)) / np.float32(here - below), out=share)
    if number + 1 < len(nodes):
        above = nodes[number + 1] ** 2
        np.minimum(share, (np.float32(above) - square) / np.float32(above - here), out=share)
    return np.maximum(share, np.float32(0.0))


def _add_layer(total: Singles, own: Singles, share: Singles, diameter_px: float) -> None:
    """Spread a layer by its disk and add it to the total."""
    used = share > 0.0
    if not used.any():
        return
    kernel = disk_kernel(diameter_px)
    pad = kernel.shape[0] // 2
    box = _box(used, pad)
    layer: Any = own[box] * share[box][..., None]
    if diameter_px > 0.0:
        layer = cv2.filter2D(layer, -1, kernel, borderType=cv2.BORDER_REPLICATE)
    total[box] += layer.reshape(total[box].shape)


@lru_cache(maxsize=64)
def disk_kernel(diameter_px: float) -> Singles:
    """Weights (K, K), K odd, of a blur disk, with the disk's own second moments d^2/16.

    A disk spread over square pixels is wider by about the pixel's own 1/12, so a slightly smaller
    one is taken; disks too small for that become three weights each way.
    """
    variance = diameter_px**2 / 16.0
    if diameter_px < _SMALL_DISK_PX:
        side = np.array([variance / 2.0, 1.0 - variance, variance / 2.0])
        return np.outer(side, side).astype(np.float32)
    low, high = 0.25 * diameter_px, 0.55 * diameter_px
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _variance(_disk(middle)) < variance else (low, middle)
    kernel = _disk(high)
    # What the fineness of the cells leaves over goes to the middle.
    kernel *= variance / _variance(kernel)
    kernel[len(kernel) // 2, len(kernel) // 2] += 1.0 - kernel.sum()
    return kernel.astype(np.float32)


def _disk(radius_px: float) -> Floats:
    """Share of each pixel that a disk covers, (K, K), of sum 1."""
    half = int(np.ceil(radius_px - 0.5))
    place = (np.arange((2 * half + 1) * _CELLS) + 0.5) / _CELLS - half - 0.5
    inside = np.hypot(place[:, None], place) <= radius_px
    kernel = inside.reshape(2 * half + 1, _CELLS, 2 * half + 1, _CELLS).mean(axis=(1, 3))
    return np.asarray(kernel / kernel.sum())


def _variance(kernel: Floats) -> float:
    place = np.arange(len(kernel)) - len(kernel) // 2
    return float((kernel.sum(axis=0) * place**2).sum())
