"""The ray of every pixel through the exact distorted camera model, worked out once per camera."""

from __future__ import annotations

import threading
from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray

from geometry.camera import Camera

Singles = NDArray[np.float32]

_ROWS = 64
_KEPT_PIXELS = 60_000_000
"""Tables are kept up to this many pixels together: 8 bytes each."""


def ray_table(camera: Camera) -> Singles:
    """x/z and y/z in the camera frame of the ray through each pixel's centre, (H, W, 2).

    Single precision is good for 0.001 px on sensors of up to 10,000 pixels.
    """
    width, height = camera.image_size_px
    table = np.empty((height, width, 2), dtype=np.float32)
    for top in range(0, height, _ROWS):
        rows = np.arange(top, min(top + _ROWS, height))
        y, x = np.meshgrid(rows.astype(np.float64), np.arange(width, dtype=float), indexing="ij")
        table[top : top + len(rows)] = camera.normalised(np.stack([x, y], axis=-1))
    table.setflags(write=False)
    return table


class RayTables:
    """Tables of the cameras seen last; cameras of one kind share one."""

    def __init__(self) -> None:
        self._tables: OrderedDict[bytes, Singles] = OrderedDict()
        self._lock = threading.Lock()

    def of(self, camera: Camera) -> Singles:
        """See :func:`ray_table`."""
        numbers = (*camera.image_size_px, camera.focal_length_px, *camera.principal_point_px)
        key = np.array([*numbers, *camera.distortion]).tobytes()
        with self._lock:
            if key not in self._tables:
                self._tables[key] = ray_table(camera)
            self._tables.move_to_end(key)
            while len(self._tables) > 1 and self._pixels() > _KEPT_PIXELS:
                self._tables.popitem(last=False)
            return self._tables[key]

    def _pixels(self) -> int:
        return sum(table.size // 2 for table in self._tables.values())


def rays_beside(
    table: Singles, rows: NDArray[np.intp], columns: NDArray[np.intp], offset_px: Singles
) -> Singles:
    """Rays (N, S, 2) at ``offset_px`` (S, 2), x and y, from the centres of N pixels.

    Within a pixel the lens is straight to 1e-4 px, so the slopes to the neighbours will do.
    """
    height, width = table.shape[:2]
    left, right = np.maximum(columns - 1, 0), np.minimum(columns + 1, width - 1)
    above, below = np.maximum(rows - 1, 0), np.minimum(rows + 1, height - 1)
    across = (table[rows, right] - table[rows, left]) / (right - left)[:, None]
    down = (table[below, columns] - table[above, columns]) / (below - above)[:, None]
    beside = (
        table[rows, columns][:, None]
        + offset_px[None, :, :1] * across.astype(np.float32)[:, None]
        + offset_px[None, :, 1:] * down.astype(np.float32)[:, None]
    )
    return np.asarray(beside, dtype=np.float32)
