"""From rays to the light on the sensor, before noise: one ray per pixel, more where it matters.

Pixels on the border of two things, at a jump of depth, or in a part of a flat thing that is not
even get 8 rays spread over their area, 32 where a flat thing is near, whose edges are measured.
All other pixels show surfaces that change little within a pixel (grain finer than a pixel is
faded out), and one ray in the middle is enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from geometry.camera import RigCamera
from rig.simulation.raytable import rays_beside
from rig.simulation.tracing import BACKDROP, FIRST_FLAT, SceneView

Singles = NDArray[np.float32]

_TILE_RAYS = 65_536
_RAYS, _RAYS_OF_FLATS = 8, 32
_DEPTH_STEP_PX = 20.0
"""A step in depth between neighbours of more than so many pixels' width is an edge."""

_UNEVEN = 0.01
"""Radiance by which neighbours on a flat thing differ for its pixels to count as edges."""

_LUMA = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)
_NEAR = np.ones((3, 3), dtype=np.uint8)


@dataclass(frozen=True, eq=False)
class SharpImage:
    """Light on the sensor of a pinhole: ``radiance`` (H, W, C), ``depth_mm`` (H, W).

    ``cover`` (H, W) is the share of each pixel that does not show the backdrop.
    """

    radiance: Singles
    depth_mm: Singles
    cover: Singles


def sharp_image(view: SceneView, rig_camera: RigCamera, table: Singles, mono: bool) -> SharpImage:
    """What a pinhole in place of the lens would show; one channel if ``mono``, else RGB."""
    height, width = table.shape[:2]
    radiance = np.empty((height, width, 1 if mono else 3), dtype=np.float32)
    depth = np.empty((height, width), dtype=np.float32)
    kind = np.empty((height, width), dtype=np.uint8)
    rows = max(1, _TILE_RAYS // width)
    columns = np.arange(width, dtype=np.float32)
    for top in range(0, height, rows):
        part = slice(top, min(top + rows, height))
        y, x = np.meshgrid(
            np.arange(part.start, part.stop, dtype=np.float32), columns, indexing="ij"
        )
        light, far, what = view.trace(x.ravel(), y.ravel(), table[part].reshape(-1, 2))
        radiance[part] = _channels(light, mono).reshape(-1, width, radiance.shape[2])
        depth[part], kind[part] = far.reshape(-1, width), what.reshape(-1, width)
    cover = (kind != BACKDROP).astype(np.float32)
    edge = _edges(radiance, depth, kind, rig_camera.camera.focal_length_px)
    flat = cv2.dilate(kind, _NEAR) >= FIRST_FLAT
    for pixels, rays in ((edge & ~flat, _RAYS), (edge & flat, _RAYS_OF_FLATS)):
        _refine(view, table, np.flatnonzero(pixels), rays, radiance, cover, depth)
    return SharpImage(radiance, depth, cover)


def fill_backdrop(
    image: SharpImage, view: SceneView, table: Singles, where: NDArray[np.bool_]
) -> Singles:
    """The radiance (H, W, C) with the backdrop alone in the pixels ``where`` (H, W)."""
    out = image.radiance.copy()
    light = view.backdrop.radiance(table[where])
    out[where] = _channels(light, out.shape[2] == 1)
    return out


def _channels(light: Singles, mono: bool) -> Singles:
    return np.asarray((light @ _LUMA)[:, None] if mono else light, dtype=np.float32)


def _edges(
    radiance: Singles, depth: Singles, kind: NDArray[np.uint8], focal_length_px: float
) -> NDArray[np.bool_]:
    """Pixels whose area one ray cannot speak for, (H, W)."""
    edge = _spread(kind) > 0
    step = _DEPTH_STEP_PX / focal_length_px * depth
    edge |= (_spread(depth) > step) & (kind != BACKDROP)
    if (kind >= FIRST_FLAT).any():
        for channel in range(radiance.shape[2]):
            plane = np.ascontiguousarray(radiance[..., channel])
            edge |= (_spread(plane) > _UNEVEN) & (kind >= FIRST_FLAT)
    return edge


def _spread(values: Singles | NDArray[np.uint8]) -> Singles | NDArray[np.uint8]:
    """Largest less smallest value among each pixel and its eight neighbours."""
    return np.asarray(cv2.dilate(values, _NEAR) - cv2.erode(values, _NEAR))


def _refine(
    view: SceneView,
    table: Singles,
    pixels: NDArray[np.intp],
    count: int,
    radiance: Singles,
    cover: Singles,
    depth: Singles,
) -> None:
    """Put the mean of ``count`` rays over their area into the pixels of the given flat indices."""
    width = table.shape[1]
    offsets = _offsets(count)
    step = _TILE_RAYS // count
    for low in range(0, len(pixels), step):
        rows, columns = np.divmod(pixels[low : low + step], width)
        rays = rays_beside(table, rows, columns, offsets).reshape(-1, 2)
        x = (columns[:, None] + offsets[:, 0]).astype(np.float32).ravel()
        y = (rows[:, None] + offsets[:, 1]).astype(np.float32).ravel()
        light, far, kind = view.trace(x, y, rays)
        several = _channels(light, radiance.shape[2] == 1).reshape(len(rows), count, -1)
        radiance[rows, columns] = several.mean(axis=1)
        cover[rows, columns] = (kind.reshape(len(rows), count) != BACKDROP).mean(axis=1)
        # Whatever is nearest gives the blur of a pixel that shows two things.
        depth[rows, columns] = far.reshape(len(rows), count).min(axis=1)


def _offsets(count: int) -> Singles:
    """Places in a pixel, (count, 2), no two in one row or column of a count x count grid."""
    order = np.arange(count)
    places = np.stack([order, 5 * order % count], axis=1) + 0.5
    return (places / count - 0.5).astype(np.float32)
