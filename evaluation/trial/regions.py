"""Figures by region of the face: what was predicted of each point, and how far off it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Bools, Floats

HALF_NOSE_MM, BROW_MM, LIP_MM = 35.0, 40.0, -15.0
"""Beside the nose's tip the cheeks begin, above it the forehead, below it the mouth."""

FEWEST = 50
"""Fewer points tell no scatter: that of 50 is known to a tenth."""


@dataclass(frozen=True)
class RegionFigures:
    """One region: errors in mm, and the predicted sigma against the scatter measured.

    ``predicted_mm`` is the median of the points' sigmas; ``measured_mm`` 1.4826 times the median
    absolute error about the median; ``ratio`` predicted to measured, point by point: above 1 the
    prediction is too careful, below 1 too bold.
    """

    name: str
    points: int
    bias_mm: float
    rms_mm: float
    predicted_mm: float
    measured_mm: float
    ratio: float


def face_regions(points_mm: Floats, nose_tip_mm: Floats) -> dict[str, Bools]:
    """Which points (N, 3) of the rig frame lie in which region; the regions share none.

    The frame's X points to the subject's left, Z up.
    """
    x, _, z = (points_mm - nose_tip_mm).T
    middle, left = np.abs(x) <= HALF_NOSE_MM, x > HALF_NOSE_MM
    above, below = z > BROW_MM, z < LIP_MM
    return {
        "forehead": above,
        "nose and eyes": middle & ~above & ~below,
        "mouth and chin": middle & below,
        "left cheek": left & ~above,
        "right cheek": ~middle & ~left & ~above,
    }


def region_figures(
    points_mm: Floats, distances_mm: Floats, sigma_mm: Floats, nose_tip_mm: Floats
) -> tuple[RegionFigures, ...]:
    """The figures of all regions with points enough, the whole first.

    ``distances_mm``, ``sigma_mm`` (N,) of ``points_mm`` (N, 3).
    """
    regions = {"all": np.ones(len(points_mm), dtype=bool)} | face_regions(points_mm, nose_tip_mm)
    return tuple(
        _figures(name, distances_mm[inside], sigma_mm[inside])
        for name, inside in regions.items()
        if inside.sum() >= FEWEST
    )


def _figures(name: str, error: Floats, sigma: Floats) -> RegionFigures:
    about = np.abs(error - np.median(error))
    spread = 1.4826 * float(np.median(about / sigma))
    return RegionFigures(
        name=name,
        points=len(error),
        bias_mm=float(error.mean()),
        rms_mm=float(np.sqrt(np.mean(error**2))),
        predicted_mm=float(np.median(sigma)),
        measured_mm=1.4826 * float(np.median(about)),
        ratio=1.0 / max(spread, 1e-12),
    )
