"""Reading pictures between their pixels, and smaller copies of them to read from."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rig.acquisition.timingboard.reading import linear_light

Singles = NDArray[np.float32]
Picture = NDArray[np.uint8] | NDArray[np.float32]

_ROW = 4096


def sampled(picture: Picture, x_px: Singles, y_px: Singles, *, sharp: bool = False) -> Picture:
    """Values (N,) or (N, C) of a picture at N places, the border repeated outside.

    Bilinear between the pixels, or, if ``sharp``, those of the pixel that a place is in.
    """
    count = len(x_px)
    if count == 0:
        return np.zeros((0, *picture.shape[2:]), dtype=picture.dtype)
    # OpenCV takes maps of less than 32,768 rows and columns, so places are laid out in long rows.
    rows = -(-count // _ROW)
    width = min(count, _ROW)
    maps = np.zeros((2, rows * width), dtype=np.float32)
    maps[0, :count], maps[1, :count] = x_px, y_px
    values: Any = cv2.remap(
        picture,
        maps[0].reshape(rows, width),
        maps[1].reshape(rows, width),
        cv2.INTER_NEAREST if sharp else cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    flat: Picture = values.reshape(rows * width, *picture.shape[2:])[:count]
    return flat


def pyramid(picture: Singles) -> tuple[Singles, ...]:
    """The picture and copies of half, a quarter... its size, each the mean of what it covers."""
    levels = [picture]
    while min(levels[-1].shape[:2]) >= 8:
        height, width = levels[-1].shape[:2]
        even = levels[-1][: height - height % 2, : width - width % 2]
        levels.append(
            0.25 * (even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2])
        )
    return tuple(np.ascontiguousarray(level, dtype=np.float32) for level in levels)


LINEAR_OF_SRGB = linear_light(np.arange(256, dtype=np.uint8)[None], linear=False)[0]
"""Share of full light for each 8-bit sRGB code, (256,)."""


def srgb_of_linear(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Codes of the sRGB curve, from 0 to 1, of shares of full light."""
    low = linear * 12.92
    high = 1.055 * np.maximum(linear, 0.0031308) ** (1.0 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, low, high)
