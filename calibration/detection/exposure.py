"""Whether a picture can show anything: too dark, too bright, or out of focus."""

from __future__ import annotations

import numpy as np

from calibration.detection import opencv
from calibration.detection.detections import PictureProblem
from calibration.detection.images import Picture

DARK = 16
"""Grey level of 255 that a picture passes somewhere, if its light is on and its cap is off."""

FULL, FULL_SHARE = 250, 0.25
"""A picture of which this share is as bright as can be lost the edges that lay there."""

SOFT_PX = 3.0
"""Sigma of the blur of the steepest edges, from which it is what hides targets of usual size."""

LEAST_CONTRAST = 16.0
"""Grey levels between the darkest and the brightest, below which there is no edge to judge."""


def unreadable(picture: Picture) -> PictureProblem | None:
    """What is wrong with the light or the focus of a picture in which nothing was found."""
    grey = picture.grey
    if np.percentile(grey, 99.9) < DARK:
        return PictureProblem(
            "dark",
            "the picture is too dark",
            "see its lens cap, its light and its exposure",
        )
    if (grey >= FULL).mean() > FULL_SHARE:
        return PictureProblem(
            "bright",
            f"the picture is too bright ({(grey >= FULL).mean():.0%} of it is white)",
            "see its light and its exposure",
        )
    blur_px = _blur_px(picture)
    if blur_px < SOFT_PX:
        return None
    return PictureProblem(
        "soft",
        f"the picture is too blurred (edges by {blur_px:.1f} px)",
        "see its focus, and whether its lens is clean",
    )


def _blur_px(picture: Picture) -> float:
    """Sigma of the blur of the steepest edges; 0 where there is no contrast to judge it by.

    An edge of height h and Gaussian blur s has the slope h / (s sqrt(2 pi)) in its middle.
    """
    smooth = opencv.smoothed(picture.grey)
    low, high = np.percentile(smooth, [1.0, 99.0])
    if high - low < LEAST_CONTRAST:
        return 0.0
    across = np.abs(smooth[:, 2:] - smooth[:, :-2]) / 2.0
    down = np.abs(smooth[2:] - smooth[:-2]) / 2.0
    slope = max(float(np.percentile(side, 99.9)) for side in (across, down))
    if slope <= 0.0:  # edges in fewer pixels than the percentile leaves out
        return 0.0
    return float(high - low) / (slope * float(np.sqrt(2.0 * np.pi)))
