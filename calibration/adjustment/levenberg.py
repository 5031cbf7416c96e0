"""Levenberg-Marquardt with Huber's loss on image points."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from calibration.adjustment.model import Partials, project
from calibration.adjustment.network import Network
from calibration.adjustment.normals import Assembler, Residuals, prior_cost, residuals
from calibration.adjustment.reduction import Reduction, SingularError
from calibration.adjustment.state import State
from common.progress import (
    CancelToken,
    NeverCancelled,
    Progress,
    ProgressCallback,
    go_on,
    ignore_progress,
)
from geometry.arrays import Floats

MOST = 0.9
MOST_OF_NORMS = 2.146
"""A vector of two standard normal numbers is shorter than this with probability :data:`MOST`."""


class Stop(StrEnum):
    """Why an adjustment stopped."""

    CONVERGED = "converged"
    ITERATIONS = "iterations"
    STUCK = "stuck"


@dataclass(frozen=True)
class LossOptions:
    """``huber``: image points and distances off by more than this many sigmas count linearly.

    At 3 about one good point in a hundred is touched, and an outlier pulls no harder than that.
    ``tolerance``: stop when the next step would lower the weighted square sum by less; 1e-6
    moves no unknown by more than a thousandth of its sigma. ``damping`` of the first step.
    """

    huber: float = 3.0
    tolerance: float = 1e-6
    max_iterations: int = 100
    damping: float = 1e-4


@dataclass(frozen=True, eq=False)
class Solution:
    """Where an adjustment ended.

    ``weights`` (n,) and ``length_weights`` (d,) of the loss are 1 for what fits.
    """

    state: State
    partials: Partials
    residuals: Residuals
    weights: Floats
    length_weights: Floats
    reduction: Reduction
    cost: float
    iterations: int
    stop: Stop


def misfits(found: Residuals, network: Network) -> Floats:
    """Length of each image point's residual in sigmas, (n,)."""
    scaled = found.pixel / network.sigma_px
    return np.asarray(np.sqrt(np.einsum("na,na->n", scaled, scaled)))


def huber_cost(misfit: Floats, limit: float) -> float:
    """Huber's loss of all image points: squares within the limit, lines beyond."""
    inside = np.minimum(misfit, limit)
    return float(np.sum(inside * (2.0 * misfit - inside)))


def _limit(misfit: Floats, options: LossOptions) -> float:
    """The limit in sigmas, wider while the start is still far off.

    So wide that nine points of ten stay quadratic: with fewer the steps would creep.
    """
    return options.huber * max(1.0, float(np.quantile(misfit, MOST)) / MOST_OF_NORMS)


def _cost(state: State, network: Network, limit: float) -> float:
    pixel, depth = project(state, network.observed)
    # A camera that a step put beyond its targets would see mirrored points: no such step.
    if not np.isfinite(pixel).all() or float(depth.min(initial=1.0)) <= 0.0:
        return np.inf
    found = residuals(state, network, pixel, depth)
    return _total(found, network, limit)


def length_misfits(found: Residuals, network: Network) -> Floats:
    """Each measured distance's residual in sigmas, without its sign, (d,)."""
    return np.abs(found.length_mm) / network.lengths.sigma_mm


def _total(found: Residuals, network: Network, limit: float) -> float:
    total = huber_cost(misfits(found, network), limit) + prior_cost(found, network)
    return total + huber_cost(length_misfits(found, network), limit)


def _huber_weights(misfit: Floats, limit: float) -> Floats:
    return np.minimum(1.0, limit / np.maximum(misfit, 1e-300))


class _Search:
    """One adjustment on its way."""

    def __init__(self, network: Network, state: State, options: LossOptions) -> None:
        self.network, self.state, self.options = network, state, options
        self.assembler = Assembler(network)
        self.damping = options.damping
        self.iterations = 0
        self.linearise()

    def linearise(self) -> None:
        """Normal equations at the present state."""
        self.parts, self.found = self.assembler.linearise(self.state)
        misfit = misfits(self.found, self.network)
        self.limit = _limit(misfit, self.options)
        self.weights = _huber_weights(misfit, self.limit)
        # A wrong distance must not bend the images to it: it is one against many rays.
        lengths = length_misfits(self.found, self.network)
        self.length_weights = _huber_weights(lengths, self.limit)
        self.cost = _total(self.found, self.network, self.limit)
        self.normals = self.assembler.gather(self.parts, self.found, self.weights)

    def reduced(self, damping: float) -> Reduction:
        """The present equations with the damping."""
        return Reduction(self.normals, self.state, self.network, self.length_weights, damping)

    def advance(self) -> Stop | None:
        """One accepted step; why it should be the last, or None."""
        factor = 2.0
        while self.damping < 1e12:
            gain = self._try()
            if gain is not None and gain < self.options.tolerance:
                return Stop.CONVERGED
            if gain is not None:
                return None
            self.damping, factor = self.damping * factor, 2.0 * factor
        return Stop.STUCK

    def _try(self) -> float | None:
        """The predicted gain when a step was taken or would be too small, None on a bad one."""
        try:
            step = self.reduced(self.damping).step()
        except SingularError:
            return None
        if step.predicted < self.options.tolerance:
            return step.predicted
        tried = self.state.moved(step.core, step.target)
        cost = _cost(tried, self.network, self.limit)
        ratio = (self.cost - cost) / step.predicted
        if not ratio > 1e-4:
            return None
        self.damping = max(1e-9, self.damping * max(0.1, 1.0 - (2.0 * ratio - 1.0) ** 3))
        self.state = tried
        self.linearise()
        return step.predicted


def adjust(
    network: Network,
    start: State,
    options: LossOptions | None = None,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> Solution:
    """The least-squares (Huber) solution from a start within reach.

    Raises :class:`SingularError` when unknowns are not determined, and :class:`CancelledError`.
    """
    options, cancel = options or LossOptions(), cancel or NeverCancelled()
    search, stop = _Search(network, start, options), None
    while stop is None and search.iterations < options.max_iterations:
        go_on(cancel)
        stop = search.advance()
        search.iterations += 1
        share = search.iterations / (search.iterations + 5.0)
        progress(Progress("adjustment", share, iteration=search.iterations, cost=search.cost))
    return Solution(
        search.state,
        search.parts,
        search.found,
        search.weights,
        search.length_weights,
        search.reduced(0.0),
        search.cost,
        search.iterations,
        stop or Stop.ITERATIONS,
    )
