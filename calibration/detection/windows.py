"""Small pieces of a picture as arrays."""

from __future__ import annotations

import numpy as np

from calibration.detection.saddle import Windows
from geometry.arrays import Floats


def square_windows(grey: np.ndarray, centres_px: Floats, half_px: int, gain: float) -> Windows:
    """Windows of ``2 half_px + 1`` pixels about each centre (n, 2), grey levels times ``gain``.

    Centres must be ``half_px`` and more inside the picture.
    """
    anchors = np.rint(centres_px).astype(np.int64)
    steps = np.arange(-half_px, half_px + 1)
    dy, dx = np.meshgrid(steps, steps, indexing="ij")
    offsets = np.column_stack([dx.ravel(), dy.ravel()])
    rows = anchors[:, 1, None] + offsets[None, :, 1]
    columns = anchors[:, 0, None] + offsets[None, :, 0]
    values = grey[rows, columns].astype(np.float64) * gain
    return Windows(values, offsets.astype(np.float64), anchors.astype(np.float64))
