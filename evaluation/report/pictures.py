"""Pictures of a cloud from three sides, as PNG in a page: no scripts, no viewer."""

from __future__ import annotations

import base64
import io

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Floats

SIDES = {"from the front": (0.0, 0.0), "from its right": (-50.0, 0.0), "from its left": (50.0, 0.0)}
"""Azimuth and elevation of the eye, degrees; 0, 0 stands at negative Y, where cameras stand."""

_SIZE_PX = 420
_BACKGROUND = 245


def splat(points_mm: Floats, colours: NDArray[np.uint8], azimuth_deg: float) -> NDArray[np.uint8]:
    """The points (N, 3) in their colours (N, 3) from one side, (420, 420, 3), nearest in front.

    Orthographic, scaled so that 99 % of the points fill the picture.
    """
    angle = np.radians(azimuth_deg)
    right = np.array([np.cos(angle), np.sin(angle), 0.0])
    ahead = np.array([-np.sin(angle), np.cos(angle), 0.0])
    middle = np.median(points_mm, axis=0)
    local = points_mm - middle
    x, y, depth = local @ right, -local[:, 2], local @ ahead
    reach = max(float(np.percentile(np.abs(v), 99.5)) for v in (x, y)) * 1.05
    scale = (_SIZE_PX / 2 - 1) / max(reach, 1e-9)
    column = np.rint(x * scale + _SIZE_PX / 2).astype(np.int64)
    row = np.rint(y * scale + _SIZE_PX / 2).astype(np.int64)
    inside = (column >= 0) & (row >= 0) & (column < _SIZE_PX) & (row < _SIZE_PX)
    # Far points first, so that nearer ones are written over them.
    order = np.flatnonzero(inside)[np.argsort(-depth[inside], kind="stable")]
    picture = np.full((_SIZE_PX, _SIZE_PX, 3), _BACKGROUND, dtype=np.uint8)
    picture[row[order], column[order]] = colours[order]
    return picture


def png_data_uri(picture: NDArray[np.uint8]) -> str:
    """A picture (H, W, 3) as a ``data:`` address that a page may hold."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode("ascii")


def blue_to_red(values: Floats, limit: float) -> NDArray[np.uint8]:
    """Signed values (N,) as colours (N, 3): blue at ``-limit``, white-grey at 0, red at ``limit``.

    The scale of C2M maps in photogrammetry: inside is blue, outside red.
    """
    share = np.clip(values / limit, -1.0, 1.0)
    middle = np.array([225.0, 225.0, 225.0])
    ends = np.where(share[:, None] < 0, [40.0, 70.0, 220.0], [215.0, 40.0, 40.0])
    mixed = middle + np.abs(share)[:, None] * (ends - middle)
    return np.asarray(np.rint(mixed), dtype=np.uint8)


def low_to_high(values: Floats, limit: float) -> NDArray[np.uint8]:
    """Values from 0 (green) over ``limit / 2`` (yellow) to ``limit`` (red), (N, 3)."""
    share = np.clip(values / limit, 0.0, 1.0)[:, None]
    green, yellow, red = (np.array(c) for c in ([40.0, 150, 70], [240.0, 205, 60], [205.0, 45, 40]))
    first = green + np.minimum(2 * share, 1.0) * (yellow - green)
    mixed = np.where(share < 0.5, first, yellow + (2 * share - 1.0) * (red - yellow))
    return np.asarray(np.rint(mixed), dtype=np.uint8)
