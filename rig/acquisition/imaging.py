"""Picture files to pixels and back: the one place in acquisition where OpenCV works on pictures.

OpenCV is imported when it is used: many commands start without it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rig.acquisition.cameras.base import Image

GLANCE_REDUCTION = 8
"""A picture read at a glance is so many times smaller each way."""


def decoded(data: bytes) -> NDArray[np.uint8] | None:
    """A picture file as (H, W, 3) RGB of 8 bits, as the sensor lay; None: unreadable."""
    import cv2

    pixels = _read(data, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    return None if pixels is None else np.ascontiguousarray(pixels[:, :, ::-1]).astype(np.uint8)


def glanced(data: bytes) -> Image | None:
    """The grey values of a picture file, an eighth of its size each way; None: unreadable."""
    import cv2

    return _read(data, cv2.IMREAD_REDUCED_GRAYSCALE_8 | cv2.IMREAD_IGNORE_ORIENTATION)


def same_pixels(one: bytes, other: bytes) -> bool:
    """Whether two picture files show the same, whatever else they say; no for unreadable ones."""
    first, second = decoded(one), decoded(other)
    return first is not None and second is not None and bool(np.array_equal(first, second))


def _read(data: bytes, flags: int) -> Image | None:
    import cv2

    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        # Each damaged file makes the library throw something else, or return nothing.
        return None
    return pixels  # type: ignore[return-value]  # its types say what other flags could give


def shrunk(pixels: Image, most_px: int) -> Image:
    """The picture, its longer side at most so many pixels; each is the mean of those it covers."""
    import cv2

    height, width = pixels.shape[:2]
    scale = min(1.0, most_px / max(height, width))
    if scale == 1.0:
        return pixels
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)  # type: ignore[return-value]  # its types forget the depth


def smoothed(grey: NDArray[np.float32], sigma_px: float) -> NDArray[np.float32]:
    """A picture (H, W) smoothed by a Gaussian."""
    import cv2

    return np.asarray(cv2.GaussianBlur(grey, (0, 0), sigma_px), dtype=np.float32)


def largest_near(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """The largest among each value (H, W) and its eight neighbours."""
    import cv2

    return np.asarray(cv2.dilate(values, np.ones((3, 3), np.uint8)), dtype=np.float32)


def jpeg(pixels: NDArray[np.uint8]) -> bytes:
    """A JPEG of (H, W) or (H, W, 3) RGB pixels, to look at."""
    import cv2

    ordered = pixels[:, :, ::-1] if pixels.ndim == 3 else pixels
    _, data = cv2.imencode(".jpg", ordered, [cv2.IMWRITE_JPEG_QUALITY, 85])
    return data.tobytes()


def png(pixels: Image) -> bytes | None:
    """A PNG of (H, W) or (H, W, 3) RGB pixels, 8 or 16 bits; None where they cannot be coded.

    By OpenCV, which knows 16-bit colour.
    """
    import cv2

    ordered = pixels[:, :, ::-1] if pixels.ndim == 3 else pixels
    # Level 1: three times as fast as the default and a few per cent larger.
    done, data = cv2.imencode(".png", ordered, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    return data.tobytes() if done else None
