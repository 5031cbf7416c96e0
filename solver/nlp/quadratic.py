"""One step of the SQP method: a convex quadratic program in a trust region, solved by PIQP."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.optimize import lsq_linear

from geometry.arrays import Floats
from solver.nlp.iterate import Iterate
from solver.nlp.program import NonlinearProgram
from solver.nlp.working_program import WorkingProgram

QP_ACCURACY = 1e-11
"""Of the quadratic programs; steps to a KKT error of 1e-8 need about three digits more."""

_AT_LIMIT = 1e-6
"""Rows this near their limit, in the solver's units of order one, are taken to bind."""

_FLAT = 0.01
"""Least curvature of a model, in start costs per squared length scale: the roll about the
optical axis is almost free, and without any curvature such directions wander."""


@dataclass(frozen=True, eq=False)
class Step:
    """Solution of one quadratic program.

    ``move`` (free,), ``multipliers`` (rows,), the ``predicted`` gain in merit and the violation
    ``left`` standing.
    """

    move: Floats
    multipliers: Floats
    predicted: float
    left: float


@dataclass(frozen=True, eq=False)
class Linearised:
    """A working program at a point: gradient (size,), Jacobian (rows, size), row values (rows,)."""

    working: WorkingProgram
    variables: Floats
    gradient: Floats
    jacobian: sparse.csc_matrix
    values: Floats

    @classmethod
    def at(cls, working: WorkingProgram, values: Floats) -> Linearised:
        """Linearise at all unknowns (7 n,)."""
        x = working.pack(values)
        row, column = working.jacobian_pattern
        jacobian = sparse.csc_matrix(
            (working.jacobian(x), (row, column)), shape=(working.rows, working.size)
        )
        return cls(working, x, working.gradient(x), jacobian, working.values(x))

    def kkt_error(self, weights: Floats) -> float:
        """Largest entry of the Lagrangian's gradient along unknowns that no bound holds."""
        free = len(self.working.free)
        residual = (self.gradient + self.jacobian.T @ weights)[:free]
        low, high = (b[:free] for b in self.working.bounds)
        here = self.variables[:free]
        residual = np.where((here <= low + 1e-9) & (residual > 0.0), 0.0, residual)
        residual = np.where((here >= high - 1e-9) & (residual < 0.0), 0.0, residual)
        return float(np.abs(residual).max(initial=0.0))

    def model(self, weights: Floats, settling: bool) -> Floats:
        """Convex model (free, free) of the Lagrangian's curvature; see :func:`convex`."""
        rows = np.flatnonzero(weights) if settling else np.zeros(0, dtype=np.int64)
        active = self.jacobian[rows][:, : len(self.working.free)].toarray()
        return convex(self.working.hessian_matrix(self.variables, weights), active)

    def shifted(self, trial: Floats, move: Floats) -> Floats:
        """Row values (rows,) for a second-order correction after ``move`` led to ``trial``."""
        slack = np.zeros(self.working.slack_count)
        return np.asarray(
            self.working.values(self.working.pack(trial)) - self.jacobian @ np.r_[move, slack]
        )


def stationarity(program: NonlinearProgram, values: Floats) -> float:
    """The KKT error at unknowns (7 n,) with the multipliers of binding rows that suit best.

    They are found by least squares, never of the wrong sign: those of a solve may be unknown
    because it ended elsewhere, or because its bounds were others.
    """
    working = Iterate.first(program, values, None, 1.0, _AT_LIMIT).working_set().program
    local = Linearised.at(working, values)
    low, high = working.row_bounds
    at_low, at_high = local.values - low < _AT_LIMIT, high - local.values < _AT_LIMIT
    rows = np.flatnonzero(at_low | at_high)
    free = len(working.free)
    here, (x_low, x_high) = local.variables[:free], (b[:free] for b in working.bounds)
    at_x_low, at_x_high = here <= x_low + 1e-9, here >= x_high - 1e-9
    held = np.flatnonzero(at_x_low | at_x_high)
    columns = np.hstack([local.jacobian[rows][:, :free].toarray().T, np.eye(free)[:, held]])
    most = np.r_[np.where(at_high[rows], np.inf, 0.0), np.where(at_x_high[held], np.inf, 0.0)]
    least = np.r_[np.where(at_low[rows], -np.inf, 0.0), np.where(at_x_low[held], -np.inf, 0.0)]
    weights = np.zeros(working.rows)
    if columns.shape[1]:
        found = lsq_linear(columns, -local.gradient[:free], (least, most), tol=1e-12).x
        weights[rows] = found[: len(rows)]
    return local.kkt_error(weights)


def convex(hessian: Floats, active: Floats) -> Floats:
    """A convex model with the curvature that counts.

    At a solution the Lagrangian may bend downwards across the rows that bind, ``active``
    (k, free), where no step goes; adding a multiple of ``active' active`` lifts it there and
    leaves the curvature along the rows, hence the speed of convergence, alone. What bends
    downwards even so is made nearly flat: the trust region and the rows end the step there.
    """
    size, basis = np.linalg.eigh(hessian)
    lift = -2.0 * size[0]
    if lift > 0.0 and len(active):
        wall = active.T @ active
        for _ in range(4):
            size, basis = np.linalg.eigh(hessian + lift * wall)
            if size[0] > 0.0:
                break
            lift *= 10.0
    size = np.maximum(size, _FLAT)
    return np.asarray((basis * size) @ basis.T)


def quadratic_step(
    iterate: Iterate, local: Linearised, model: Floats, row_values: Floats
) -> Step | None:
    """Minimise the model within the trust region, or None where PIQP finds no answer.

    ``row_values`` (rows,) are the rows' values where the step begins.
    """
    import piqp

    working, radius = local.working, iterate.radius
    free, slack = len(working.free), working.slack_count
    low, high = working.row_bounds
    here = local.variables[:free]
    x_low, x_high = working.bounds
    box_low = np.r_[np.maximum(-radius, x_low[:free] - here), np.zeros(slack)]
    box_high = np.r_[np.minimum(radius, x_high[:free] - here), np.full(slack, np.inf)]
    solver = piqp.SparseSolver()
    solver.settings.eps_abs = QP_ACCURACY
    solver.settings.eps_rel = QP_ACCURACY
    quadratic = sparse.block_diag([model, sparse.csc_matrix((slack, slack))], format="csc")
    solver.setup(
        quadratic,
        local.gradient,
        None,
        None,
        local.jacobian,
        low - row_values,
        high - row_values,
        box_low,
        box_high,
    )
    status = solver.solve()
    result = solver.result
    solved = status in (piqp.Status.PIQP_SOLVED, piqp.Status.PIQP_MAX_ITER_REACHED)
    if not solved or not np.isfinite(result.x).all():
        return None
    move = np.clip(result.x[:free], box_low[:free], box_high[:free])
    cost = float(local.gradient[:free] @ move + 0.5 * move @ model @ move)
    charged = float(local.gradient[free:] @ np.maximum(result.x[free:], 0.0))
    standing = iterate.penalty.charge(iterate.program, iterate.point.violations)
    left = float(result.x[free : free + len(working.soft)].max(initial=0.0))
    return Step(move, np.asarray(result.z_u - result.z_l), standing - cost - charged, left)
