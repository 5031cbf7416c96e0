"""Variance components: whether each group of observations is as good as was stated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.covariance import Covariance
from calibration.adjustment.levenberg import Solution
from calibration.adjustment.network import Network
from calibration.adjustment.reliability import Reliability
from geometry.arrays import Bools, Floats, Ints

LEAST_REDUNDANCY = 10.0
SIGNIFICANT = 3.0
"""A component is believed to differ from 1 beyond this many of its own sigmas."""


@dataclass(frozen=True)
class Component:
    """One group: ``factor`` of its stated sigma that its residuals ask for, ``redundancy``."""

    name: str
    factor: float
    redundancy: float
    count: int

    @property
    def significant(self) -> bool:
        """Whether the factor differs from 1 by more than chance explains."""
        if self.redundancy < LEAST_REDUNDANCY:
            return False
        scatter = np.sqrt(2.0 / self.redundancy)
        return bool(abs(self.factor**2 - 1.0) > SIGNIFICANT * scatter)


def _component(name: str, squares: Floats, redundancy: Floats) -> Component:
    total = float(redundancy.sum())
    factor = float(np.sqrt(squares.sum() / total)) if total > 1e-6 else 1.0
    return Component(name, factor, total, int(np.size(squares)))


def image_components(
    solution: Solution, network: Network, found: Reliability
) -> tuple[Component, ...]:
    """Of all image points, then of each camera's (Foerstner's estimate)."""
    squares = solution.weights[:, None] * (solution.residuals.pixel / network.sigma_px) ** 2
    rows = network.camera_rows
    parts = [("images", slice(None))]
    parts += [
        (f"images/{name}", slice(rows[k], rows[k + 1]))
        for k, name in enumerate(network.camera_names)
    ]
    return tuple(_component(name, squares[p], found.redundancy[p]) for name, p in parts)


def prior_components(
    solution: Solution, network: Network, covariance: Covariance
) -> tuple[Component, ...]:
    """Of nominal target coordinates, measured distances and interior priors."""
    return (
        _targets(solution, network, covariance),
        _lengths(solution, network, covariance),
        _interiors(solution, network, covariance),
    )


def _observed(sigma: Floats) -> Bools:
    return np.isfinite(sigma) & (sigma > 0.0)


def _targets(solution: Solution, network: Network, covariance: Covariance) -> Component:
    sigma = network.priors.target_sigma
    known = _observed(sigma)
    spread = np.einsum("maa->ma", covariance.targets())[known]
    squares = (solution.residuals.target[known] / sigma[known]) ** 2
    return _component("coordinates", squares, 1.0 - spread / sigma[known] ** 2)


def _interiors(solution: Solution, network: Network, covariance: Covariance) -> Component:
    sigma = network.priors.interior_sigma
    known = _observed(sigma)
    variances = np.diag(covariance.cameras).reshape(len(sigma), -1)[:, : sigma.shape[1]]
    squares = (solution.residuals.interior[known] / sigma[known]) ** 2
    return _component("interiors", squares, 1.0 - variances[known] / sigma[known] ** 2)


def length_partials(target: Floats, first: Ints, second: Ints) -> Floats:
    """Partials (d, m, 3) of distances between targets ``first`` and ``second`` (d,)."""
    direction = target[second] - target[first]
    direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    rows, number = np.zeros((len(direction), len(target), 3)), np.arange(len(direction))
    rows[number, second], rows[number, first] = direction, -direction
    return rows


def _lengths(solution: Solution, network: Network, covariance: Covariance) -> Component:
    lengths = network.lengths
    rows = length_partials(solution.state.target, lengths.first, lengths.second)
    nothing = np.zeros((len(rows), len(covariance.cameras)))
    spread = np.diag(covariance.of_functions(nothing, rows))
    squares = (solution.residuals.length_mm / lengths.sigma_mm) ** 2
    # What the loss holds back takes less part in the fit, and is checked by the others more.
    redundancy = 1.0 - solution.length_weights * spread / lengths.sigma_mm**2
    return _component("distances", squares, redundancy)
