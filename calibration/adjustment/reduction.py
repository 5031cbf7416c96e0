"""Targets eliminated (Schur complement), the core solved, and covariances from both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from calibration.adjustment.covariance import Covariance
from calibration.adjustment.datum import inner_constraints
from calibration.adjustment.network import Network
from calibration.adjustment.normals import Normals
from calibration.adjustment.state import State
from geometry.arrays import Floats


class SingularError(ArithmeticError):
    """The normal equations have no solution: something is not determined."""


@dataclass(frozen=True, eq=False)
class Step:
    """``core`` (c,), ``target`` (m, 3); ``predicted`` fall of the cost if all were linear."""

    core: Floats
    target: Floats
    predicted: float


@dataclass(frozen=True, eq=False)
class _System:
    """The core with kept targets: matrix (r, r), coupling (r, e, 3), blocks (e, 3, 3)."""

    core: Floats
    cross: Floats
    blocks: Floats
    core_right: Floats
    right: Floats


def _length_rows(state: State, network: Network, weights: Floats) -> tuple[Floats, Floats]:
    """Weighted partials (d, kept, 3) of the distances by the kept targets, and misfits (d,)."""
    root = np.sqrt(weights)
    lengths = network.lengths
    between = state.target[lengths.second] - state.target[lengths.first]
    computed = np.linalg.norm(between, axis=1)
    direction = between / (computed * lengths.sigma_mm)[:, None]
    rows = np.zeros((len(computed), len(network.kept), 3))
    number = np.arange(len(computed))
    rows[number, np.searchsorted(network.kept, lengths.second)] = direction
    rows[number, np.searchsorted(network.kept, lengths.first)] = -direction
    rows *= network.target_free[network.kept] * root[:, None, None]
    return rows, root * (lengths.length_mm - computed) / lengths.sigma_mm


def _system(normals: Normals, state: State, network: Network, weights: Floats) -> _System:
    kept, taken, c = network.kept, network.eliminated, network.core_count
    if len(kept) == 0:
        return _System(
            normals.core, normals.cross, normals.target, normals.core_right, normals.target_right
        )
    size = c + 3 * len(kept)
    core, right = np.zeros((size, size)), np.zeros(size)
    core[:c, :c], right[:c] = normals.core, normals.core_right
    core[:c, c:] = normals.cross[:, kept].reshape(c, -1)
    core[c:, :c] = core[:c, c:].T
    for k, target in enumerate(kept):
        place = slice(c + 3 * k, c + 3 * k + 3)
        core[place, place], right[place] = normals.target[target], normals.target_right[target]
    rows, misfit = _length_rows(state, network, weights)
    flat = rows.reshape(len(rows), -1)
    core[c:, c:] += flat.T @ flat
    right[c:] += flat.T @ misfit
    cross = np.zeros((size, len(taken), 3))
    cross[:c] = normals.cross[:, taken]
    return _System(core, cross, normals.target[taken], right, normals.target_right[taken])


class Reduction:
    """The normal equations with damping, reduced to the core and factored.

    ``length_weights`` (d,) of the robust loss; ``damping`` multiplies the diagonal by
    ``1 + damping`` (Levenberg, Marquardt). Raises :class:`SingularError` when something is not
    determined.
    """

    def __init__(
        self,
        normals: Normals,
        state: State,
        network: Network,
        length_weights: Floats,
        damping: float = 0.0,
    ) -> None:
        self._network = network
        system = _system(normals, state, network, length_weights)
        self._right = system.core_right, system.right
        taken = system.blocks * (1.0 + damping * np.eye(3))
        try:
            self._inverse: Floats = np.asarray(np.linalg.inv(taken), np.float64)
        except np.linalg.LinAlgError as error:
            raise SingularError("a target is not determined") from error
        cross = np.swapaxes(system.cross, 0, 1)
        # (e, r, 3): minus what the core does to each eliminated target.
        self._effect = cross @ self._inverse
        flat = np.swapaxes(self._effect, 0, 1).reshape(len(system.core), -1)
        reduced = system.core - flat @ system.cross.reshape(len(system.core), -1).T
        places = np.arange(len(reduced))
        reduced[places, places] += damping * system.core[places, places]
        self._flat = flat
        self._datum = self._constraints(state, reduced) if network.datum else None
        if self._datum is not None:
            reduced += self._datum @ self._datum.T
        self._factor(reduced)

    def _constraints(self, state: State, reduced: Floats) -> Floats:
        """Constraints of the size of the matrix they join, so that it stays well conditioned."""
        rows = inner_constraints(state, self._network)
        share = rows * rows
        size = share.T @ np.diag(reduced)[: len(rows)] / share.sum(axis=0)
        out = np.zeros((len(reduced), rows.shape[1]))
        out[: len(rows)] = rows * np.sqrt(size)
        free = np.ones(len(reduced), bool)
        free[: len(rows)] = self._network.core_free
        return out * free[:, None]

    def _factor(self, reduced: Floats) -> None:
        diagonal = np.diag(reduced)
        if not (np.isfinite(diagonal).all() and (diagonal > 0.0).all()):
            raise SingularError("an unknown is not observed at all")
        self._scale = 1.0 / np.sqrt(diagonal)
        try:
            self._cholesky = cho_factor(
                reduced * self._scale[:, None] * self._scale, lower=True, check_finite=False
            )
        except np.linalg.LinAlgError as error:
            raise SingularError("the unknowns cannot be told apart") from error

    def _solve(self, right: Floats) -> Floats:
        scale = self._scale.reshape((-1,) + (1,) * (right.ndim - 1))
        return np.asarray(scale * cho_solve(self._cholesky, right * scale, check_finite=False))

    def step(self) -> Step:
        """The step that the equations ask for."""
        core_right, right = self._right
        own = np.einsum("eij,ej->ei", self._inverse, right)
        inner = self._solve(core_right - self._flat @ right.ravel())
        outer = own - (self._flat.T @ inner).reshape(-1, 3)
        network, c = self._network, self._network.core_count
        target = np.zeros((network.target_count, 3))
        target[network.eliminated] = outer
        target[network.kept] = inner[c:].reshape(-1, 3)
        gain = float(core_right @ inner + np.sum(right * outer))
        return Step(inner[:c], target, gain)

    def covariance(self) -> Covariance:
        """Covariance of all unknowns in the datum; only of an undamped system.

        With constraints B added to the matrix, ``M = N + B B^T``, the covariance that meets
        them is ``Q = M^-1 - H H^T`` with ``H = M^-1 B``: the second term takes out the
        uncertainty of the frame that the first one let in.
        """
        size = len(self._scale)
        root = solve_triangular(
            self._cholesky[0], np.eye(size), lower=True, check_finite=False, overwrite_b=True
        )
        core = (root.T @ root) * self._scale[:, None] * self._scale
        if self._datum is not None:
            free = core @ self._datum
            core -= free @ free.T
        return Covariance.built(self._network, core, -self._flat.T, self._inverse)
