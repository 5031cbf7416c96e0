"""Redundancy numbers and Baarda's tests: how well observations check one another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import PER_CAMERA
from calibration.adjustment.covariance import Covariance
from calibration.adjustment.levenberg import Solution
from calibration.adjustment.network import Network
from geometry.arrays import Floats, Ints

CHUNK = 4096
DELTA0 = 4.13
"""Baarda's noncentrality: seen with power 80 % by a test that errs in 0.1 % of cases."""


@dataclass(frozen=True, eq=False)
class Reliability:
    """Of image points. ``redundancy`` (n, 2) of x and y, 0 (nothing checks it) to 1.

    ``w`` (n, 2): residual over its own sigma (Baarda). ``t`` (n,): both coordinates at once,
    chi-square with two degrees of freedom when the point is good.
    """

    redundancy: Floats
    w: Floats
    t: Floats

    def smallest_blunder_px(self, sigma_px: Floats) -> Floats:
        """Smallest blunder (n, 2) that the w-test finds, px: ``delta0 sigma / sqrt(r)``."""
        return np.asarray(DELTA0 * sigma_px / np.sqrt(np.maximum(self.redundancy, 1e-12)))


def _fitted_covariance(solution: Solution, covariance: Covariance, network: Network) -> Floats:
    """Covariance (n, 2, 2) of the adjusted image points, px^2."""
    size, parts, observed = len(covariance.core), solution.partials, network.observed
    rows = covariance.target_rows().reshape(-1, 3, size)
    own = covariance.own_blocks()
    out = np.empty((len(network.pixel), 2, 2))
    for begin in range(0, len(out), CHUNK):
        part = slice(begin, begin + CHUNK)
        line = parts.target[part] @ rows[observed.target[part]]
        _add(line, parts.camera[part], PER_CAMERA * observed.camera[part], PER_CAMERA)
        if network.pose_count:
            first = PER_CAMERA * network.camera_count
            _add(line, parts.pose[part], first + 6 * observed.pose[part], 6)
        product = (line.reshape(-1, size) @ covariance.core).reshape(line.shape)
        inner = np.einsum("nar,nbr->nab", product, line)
        by_target = parts.target[part]
        out[part] = inner + by_target @ own[observed.target[part]] @ np.swapaxes(by_target, 1, 2)
    return out


def _add(line: Floats, block: Floats, first: Ints, width: int) -> None:
    columns = first[:, None] + np.arange(width)
    number = np.arange(len(line))
    for axis in range(2):
        line[number[:, None], axis, columns] += block[:, axis]


def reliability(solution: Solution, covariance: Covariance, network: Network) -> Reliability:
    """Redundancy numbers and tests of all image points; ``covariance`` for stated sigmas."""
    fitted = _fitted_covariance(solution, covariance, network)
    variance = network.sigma_px**2
    weights = solution.weights[:, None]
    spread = np.einsum("naa->na", fitted)
    # A point that the loss holds back has a weight below one and so takes less of the fit.
    redundancy = np.clip(1.0 - weights * spread / variance, 0.0, 1.0)
    # The residual's own variance: an observation that takes part makes it smaller, one that is
    # held back entirely adds the fit's uncertainty to its own.
    left = (1.0 - 2.0 * weights)[:, :, None] * fitted
    axes = np.arange(2)
    left[:, axes, axes] += variance
    # What nothing checks has a residual of zero with variance zero: its test says nothing.
    left[:, axes, axes] = np.maximum(left[:, axes, axes], 1e-9 * variance)
    v = solution.residuals.pixel
    w = v / np.sqrt(np.einsum("naa->na", left))
    determinant = left[:, 0, 0] * left[:, 1, 1] - left[:, 0, 1] ** 2
    checked = determinant > 1e-6 * variance[:, 0] * variance[:, 1]
    numerator = (
        left[:, 1, 1] * v[:, 0] ** 2
        + left[:, 0, 0] * v[:, 1] ** 2
        - 2.0 * left[:, 0, 1] * v[:, 0] * v[:, 1]
    )
    t = np.where(checked, numerator / np.where(checked, determinant, 1.0), np.max(w * w, axis=1))
    return Reliability(redundancy, w, t)
