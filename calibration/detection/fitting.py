"""One target's picture cut out, fitted and gated: what markers and ring targets share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.detection import localmap
from calibration.detection.detections import SIGMA_FLOOR_PX, Point
from calibration.detection.gates import Gates, Rejection, Rule
from calibration.detection.images import Picture
from calibration.detection.template import TemplateFit, Window, fit_template
from calibration.targets.patterns import Pattern
from geometry.arrays import Floats

LARGEST_WINDOW_PX = 60
"""Larger windows are binned: their targets have pixels to spare, and the time grows with them."""

_MARGIN_PX = 2


@dataclass(frozen=True, eq=False)
class Fitted:
    """A target that passed all gates but those of its neighbours."""

    fit: TemplateFit

    @property
    def misfit(self) -> float:
        """Rms residual over contrast."""
        return self.fit.noise / self.fit.step

    @property
    def patch(self) -> float:
        """Largest mean residual of 3 x 3 pixels over contrast."""
        return self.fit.patch / self.fit.step


def fit_target(
    picture: Picture,
    pattern: Pattern,
    start: Floats,
    detail_px: float,
    gates: Gates,
    held_map: bool = False,
) -> Fitted | tuple[Rule, float, float]:
    """Fit a target, or the rule that it breaks with what was measured and the limit.

    ``detail_px`` is the size of its details in the picture, which the blur is compared with.
    ``held_map``: how the target lies is known from ``start``, only where it is is not.
    """
    cut = _cut(picture, pattern, start, gates)
    if not isinstance(cut, Window):
        return cut
    clipped = float(((cut.values <= 0.5) | (cut.values >= 254.5)).mean())
    if clipped > gates.saturated_share:
        return Rule.SATURATION, clipped, gates.saturated_share
    factor = max(1, round(max(cut.values.shape) / LARGEST_WINDOW_PX))
    window = cut.binned(factor) if factor > 1 else cut
    fit = fit_template(pattern, window, start, picture.size_px, held_map)
    if fit is None or not fit.converged:
        return Rule.FIT, 1.0, gates.misfit
    if fit.step < gates.contrast:
        return Rule.CONTRAST, fit.step, gates.contrast
    if fit.blur_px > gates.blur_share * 2.0 * detail_px:
        return Rule.BLUR, fit.blur_px / (2.0 * detail_px), gates.blur_share
    found = Fitted(fit)
    return (Rule.FIT, found.misfit, gates.misfit) if found.misfit > gates.misfit else found


def _cut(
    picture: Picture, pattern: Pattern, start: Floats, gates: Gates
) -> Window | tuple[Rule, float, float]:
    """The piece of the picture that shows the target's paper."""
    seen = localmap.to_picture(start, pattern.outline_mm)
    if not np.isfinite(seen).all():
        return Rule.FIT, 1.0, gates.misfit
    low, high = seen.min(axis=0), seen.max(axis=0)
    width, height = picture.size_px
    room = float(min(low.min(), width - 1.0 - high[0], height - 1.0 - high[1]))
    if room < gates.edge_px:
        return Rule.EDGE, room, gates.edge_px
    x0, y0 = (max(int(v) - _MARGIN_PX, 0) for v in low)
    x1, y1 = int(high[0]) + _MARGIN_PX + 2, int(high[1]) + _MARGIN_PX + 2
    values = picture.levels[y0:y1, x0:x1].astype(np.float64) * picture.gain
    return Window(values, (float(x0), float(y0)))


def rejected(name: str, why: tuple[Rule, float, float], pixel: Floats) -> Rejection:
    """A rejection of the target about ``pixel`` (2,)."""
    return Rejection(name, *why, (float(pixel[0]), float(pixel[1])))


def point_of(name: str, found: Fitted, place_mm: Floats) -> Point:
    """Where a place (2,) on the target appears, with its sigma from the fit's covariance."""
    parameters = found.fit.parameters[: localmap.SIZE]
    pixel = localmap.to_picture(parameters, place_mm[None])
    there = localmap.to_target(parameters, pixel)
    partials = -np.linalg.solve(there.by_pixel[0], there.by_parameter[0])
    covariance = partials @ found.fit.covariance[: localmap.SIZE, : localmap.SIZE] @ partials.T
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0) + SIGMA_FLOOR_PX**2)
    x, y = pixel[0]
    return Point(name, (float(x), float(y)), (float(sigma[0]), float(sigma[1])), found.fit.blur_px)
