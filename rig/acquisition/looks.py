"""What a person wants to know of a picture at once: is it sharp, is it well exposed; and it, small.

Blur is measured at edges: smoothed a little and smoothed more, an edge that was blurred already
loses less of its steepness (Zhuo and Sim, "Defocus map estimation from a single image", Pattern
Recognition 44, 2011).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.acquisition.cameras.base import Frame, Image
from rig.acquisition.imaging import decoded, jpeg, largest_near, shrunk, smoothed

Singles = NDArray[np.float32]

MIDDLE_PX = 1024
"""Sharpness is judged in a square of so many pixels in the middle: there the face is."""

_FINE_PX, _COARSE_PX = 1.0, 2.0
_DIFFERENCE_PX2 = 1.0 / 3.0
"""Variance of what a difference over two pixels adds: that of a box two pixels wide."""

_STEEPEST_SHARE = 0.01
_LEAST_STEP = 0.01
"""Edges are pixels among the steepest, at least so steep in shares of white per pixel."""

_FEWEST_EDGES = 12
_SHARP_QUARTILE = 25.0
"""Of all edges the sharper ones count: others lie outside the depth of field, or are shadows."""

SHARP_PX = 1.5
"""Blur at which detail of eight pixels keeps half its contrast, exp(-2 (pi blur / 8)^2): less than
matching lives on. Two pixels of defocus, as designs allow, are half a pixel of blur."""

WHITE = 0.98
MOST_WHITE = 0.005
DARK = {8: 0.25, 16: 0.05}
"""A picture is dark whose 99th percentile is below this share of white: 8 bits are gamma coded."""

SMALL_PX = 960
"""The longer side of a small picture."""

_SHOWN_LEVEL, _MOST_GAIN = 0.8, 16.0


@dataclass(frozen=True)
class Look:
    """What a picture is like. ``size_px`` (width, height).

    ``blur_px``: standard deviation of what spreads the sharper edges of its middle, None where it
    shows no edges. ``focus``: steepness of its middle, squared and over brightness; for comparing
    pictures of one camera while its ring is turned. ``white``: share of pixels that are white.
    ``level``: its 99th percentile, as a share of white.
    """

    size_px: tuple[int, int]
    blur_px: float | None
    focus: float
    white: float
    level: float
    dark: bool

    @property
    def sharp(self) -> bool | None:
        """Whether it is sharp; None where it shows no edges to tell by."""
        return None if self.blur_px is None else self.blur_px <= SHARP_PX

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is wrong with the exposure, in words."""
        told = []
        if self.white > MOST_WHITE:
            told.append(f"{100.0 * self.white:.1f} % of it is white: less light or exposure")
        if self.dark:
            told.append("dark: more light or exposure, unless a flash lights the captures")
        return tuple(told)


def pixels_of(frame: Frame) -> Image | None:
    """The picture (H, W) or (H, W, 3) RGB of a frame; None where it cannot be read."""
    if frame.pixels is not None:
        return frame.pixels
    return decoded(frame.encoded) if frame.encoded else None


def look_at(pixels: Image) -> Look:
    """Look at (H, W) or (H, W, 3) pixels of 8 or 16 bits."""
    height, width = pixels.shape[:2]
    depth = np.iinfo(pixels.dtype)
    top, left = max(0, (height - MIDDLE_PX) // 2), max(0, (width - MIDDLE_PX) // 2)
    middle = _grey(pixels[top : top + MIDDLE_PX, left : left + MIDDLE_PX])
    fine, coarse = _steepness(middle, _FINE_PX), _steepness(middle, _COARSE_PX)
    brightest = pixels[::2, ::2].reshape(-1, *pixels.shape[2:])
    if brightest.ndim == 2:
        brightest = brightest.max(axis=1)
    level = float(np.percentile(brightest, 99.0)) / depth.max
    return Look(
        size_px=(width, height),
        blur_px=_blur_px(fine, coarse),
        focus=float(np.sum(fine**2)) / max(fine.size, 1) / max(float(middle.mean()) ** 2, 1e-6),
        white=float(np.mean(brightest >= WHITE * depth.max)),
        level=level,
        dark=level < DARK[depth.bits],
    )


def small_jpeg(pixels: Image, look: Look) -> tuple[bytes, float]:
    """A JPEG of at most :data:`SMALL_PX`, and by how much a dark picture was brightened for it."""
    gain = 1.0
    if look.dark:
        gain = min(_SHOWN_LEVEL / max(look.level, 1e-3), _MOST_GAIN)
    small = shrunk(pixels, SMALL_PX)
    shown = small.astype(np.float32) * (255.0 * gain / np.iinfo(pixels.dtype).max)
    return jpeg(np.clip(np.rint(shown), 0, 255).astype(np.uint8)), gain


def _grey(pixels: Image) -> Singles:
    grey = pixels.astype(np.float32) / np.float32(np.iinfo(pixels.dtype).max)
    return np.asarray(grey.mean(axis=2) if grey.ndim == 3 else grey, dtype=np.float32)


def _steepness(grey: Singles, sigma_px: float) -> Singles:
    """How steep a smoothed picture is at each pixel but those of the border, per pixel."""
    smooth = smoothed(grey, sigma_px)
    across = 0.5 * (smooth[1:-1, 2:] - smooth[1:-1, :-2])
    down = 0.5 * (smooth[2:, 1:-1] - smooth[:-2, 1:-1])
    return np.asarray(np.hypot(across, down), dtype=np.float32)


def _blur_px(fine: Singles, coarse: Singles) -> float | None:
    if fine.size == 0:
        return None
    steep = max(float(np.quantile(fine, 1.0 - _STEEPEST_SHARE)), _LEAST_STEP)
    peak = (fine >= steep) & (fine >= largest_near(fine))
    if np.count_nonzero(peak) < _FEWEST_EDGES:
        return None
    square = (fine[peak] / coarse[peak]) ** 2
    fine_px2, coarse_px2 = _FINE_PX**2 + _DIFFERENCE_PX2, _COARSE_PX**2 + _DIFFERENCE_PX2
    # The peak of an edge of variance v falls as 1 / sqrt(v + s^2) when it is smoothed with s.
    blur_px2 = (coarse_px2 - square * fine_px2) / np.maximum(square - 1.0, 1e-6)
    return float(np.sqrt(max(0.0, float(np.percentile(blur_px2, _SHARP_QUARTILE)))))
