"""Sequential quadratic programming with exact second derivatives and constraint exchange.

Each step solves a quadratic model of the cost under the linearised rows inside a trust region;
the quadratic programme goes to PIQP, a proximal interior-point solver. Compared with handing
each working set to a general interior-point solver, rows can join at every step and nothing is
lost when they do: interior points cannot start warm, and exchange is nothing but restarts.

Every family of rows may be broken at a price, so a step exists even where the linearised rows
contradict each other: an exact penalty on the family's worst row, or on every row of the
families in which one that cannot be had must not excuse the others. Fletcher, Practical Methods
of Optimization, 2nd ed., section 14.4 (S l1 QP); second-order correction as there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from geometry.arrays import Floats
from solver.nlp.iterate import FEASIBLE, LARGEST_PRICE, Run, Task
from solver.nlp.program import Programme

Watch = Callable[[int, float, float], bool]
"""Called with iteration, cost and violation; returns False to stop."""

FIRST_RADIUS = 0.2
"""First trust radius, in length scales and radians: about 11 degrees round the subject."""

LARGEST_RADIUS = 0.5
SMALLEST_RADIUS = 1e-9
FIRST_PRICE = 50.0
QP_ACCURACY = 1e-11
"""Of the quadratic programmes; steps to a KKT error of 1e-8 need about three digits more."""

_FLAT = 0.01
"""Least curvature of a model, in start costs per squared length scale: the turn about the
optical axis is almost free, and without any curvature such directions wander."""

CORRECTIONS = 3
"""Most second-order corrections of a step. Each costs a small part of what a new step costs, and
rows that bend let a step be as long as the model holds, not as the rows are straight."""

SETTLING = 0.01
"""Steps shorter than this are taken among rows that will bind at the solution."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """Where a solve ended.

    ``values`` (7 n,) all unknowns; ``multipliers`` one array per block of candidate rows, with
    ``L = f + sum multipliers . rows``; ``violation`` the worst breach of any candidate row;
    ``why`` a sentence without a full stop.
    """

    values: Floats
    multipliers: list[Floats]
    kkt_error: float
    violation: float
    iterations: int
    converged: bool
    stopped: bool
    why: str


@dataclass(frozen=True, eq=False)
class _Step:
    """Solution of one quadratic programme."""

    move: Floats
    multipliers: Floats
    predicted: float
    left: float


def _convex(hessian: Floats, active: Floats) -> Floats:
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


def _quadratic_step(
    run: Run,
    programme: Programme,
    model: Floats,
    gradient: Floats,
    jacobian: sparse.csc_matrix,
    offsets: Floats,
) -> _Step | None:
    """Minimise the model within the trust region; ``offsets`` (rows,) are the rows' values at 0."""
    import piqp

    free, soft = len(programme.free), programme.concession_count
    low, high = programme.row_bounds
    here = run.values[programme.free]
    x_low, x_high = programme.bounds
    box_low = np.r_[np.maximum(-run.radius, x_low[:free] - here), np.zeros(soft)]
    box_high = np.r_[np.minimum(run.radius, x_high[:free] - here), np.full(soft, np.inf)]
    # PIQP wants every row of its matrix bounded by numbers it can scale.
    solver = piqp.SparseSolver()
    solver.settings.eps_abs = QP_ACCURACY
    solver.settings.eps_rel = QP_ACCURACY
    quadratic = sparse.block_diag([model, sparse.csc_matrix((soft, soft))], format="csc")
    solver.setup(
        quadratic, gradient, None, None, jacobian, low - offsets, high - offsets, box_low, box_high
    )
    status = solver.solve()
    result = solver.result
    if (
        status not in (piqp.Status.PIQP_SOLVED, piqp.Status.PIQP_MAX_ITER_REACHED)
        or not np.isfinite(result.x).all()
    ):
        return None
    move = np.clip(result.x[:free], box_low[:free], box_high[:free])
    give = float(gradient[free:] @ np.maximum(result.x[free:], 0.0))
    predicted = (
        run.paid(run.breaches) - float(gradient[:free] @ move + 0.5 * move @ model @ move) - give
    )
    left = float(result.x[free : free + len(programme.soft)].max(initial=0.0))
    return _Step(move, np.asarray(result.z_u - result.z_l), predicted, left)


def minimise(
    task: Task,
    start: Floats,
    watch: Watch,
    *,
    tolerance: float = 1e-7,
    gain_tolerance: float = 1e-9,
    known: list[Floats] | None = None,
    max_iterations: int = 200,
    price: float = FIRST_PRICE,
    radius: float = FIRST_RADIUS,
) -> Outcome:
    """Minimise from ``start`` (7 n,).

    Stops when the optimality conditions hold to ``tolerance``, or when the last three steps
    were feasible and together gained less than ``gain_tolerance``. ``known`` multipliers of an
    earlier solve of the same rows, to which others may have been added at the end, speed it up;
    ``radius`` is the first trust radius and ``price`` the first price of a breach.
    """
    run = Run(task, start, known, price, radius)
    kkt, why, converged, stopped, iteration = (
        np.inf,
        "the limit of iterations was reached",
        False,
        False,
        0,
    )
    for iteration in range(max_iterations + 1):
        worst = run.worst
        if not watch(iteration, run.cost, worst):
            stopped, why = True, "stopped by request"
            break
        programme = run.programme()
        x = programme.pack(run.values)
        gradient, jacobian = programme.gradient(x), _sparse(programme, x)
        weights = programme.from_blocks(
            [m[c] for m, c in zip(run.multipliers, run.chosen, strict=True)]
        )
        kkt = _kkt(run, programme, gradient, jacobian, weights)
        if kkt < tolerance and worst < FEASIBLE and not run.unpriced:
            converged, why = True, "the optimality conditions hold to the tolerance"
            break
        if worst < max(FEASIBLE, 0.005 * gain_tolerance) and _idle(run.gains, gain_tolerance):
            converged, why = (
                True,
                f"three steps together gained less than {gain_tolerance:g} of the cost",
            )
            break
        if run.radius < SMALLEST_RADIUS:
            if worst < FEASIBLE or run.price >= LARGEST_PRICE:
                why = "no step in reach improves the network any further"
                break
            run.price, run.radius = run.price * 10.0, 0.01
            continue
        if iteration == max_iterations:
            break
        settling = worst < 1e-4 and run.reach < SETTLING
        active = jacobian[np.flatnonzero(weights) if settling else []][
            :, : len(programme.free)
        ].toarray()
        model = _convex(programme.hessian_matrix(x, weights), active)
        step = _quadratic_step(run, programme, model, gradient, jacobian, programme.values(x))
        if step is None:
            run.radius *= 0.25
            continue
        _try(run, programme, step, model, gradient, jacobian)
    return Outcome(run.values, run.multipliers, kkt, run.worst, iteration, converged, stopped, why)


def _idle(gains: list[float], tolerance: float) -> bool:
    """Whether the last three steps together gained less than ``tolerance``."""
    return len(gains) > 2 and sum(gains[-3:]) < tolerance


def _try(
    run: Run,
    programme: Programme,
    step: _Step,
    model: Floats,
    gradient: Floats,
    jacobian: sparse.csc_matrix,
) -> None:
    """Take the step if the merit falls as predicted; else correct it once, or shrink the region."""
    before = run.merit(run.cost, run.breaches)
    noise = 1e-13 * max(1.0, abs(before))
    if step.predicted <= noise:
        run.remember(programme, step.multipliers)
        # Nothing is left to gain here at this price; what is still broken needs a higher one.
        broken = run.worst > FEASIBLE
        run.price = min(run.price * 10.0, LARGEST_PRICE) if broken else run.price
        run.radius *= 0.25
        return
    for attempt in range(1 + CORRECTIONS):
        trial, cost, breaches = _at(run, programme, step.move)
        gain = before - run.merit(cost, breaches) if np.isfinite(cost) else -np.inf
        ratio = (gain + noise) / (step.predicted + noise)
        if ratio > 0.05:
            reach = run.reach = float(np.abs(step.move).max(initial=0.0))
            worst = run.worst
            run.values, run.cost, run.breaches = trial, cost, breaches
            run.gains.append(gain)
            run.remember(programme, step.multipliers)
            run.reprice(worst, step.left)
            if ratio > 0.7 and reach > 0.8 * run.radius:
                run.radius = min(2.0 * run.radius, LARGEST_RADIUS)
            elif ratio < 0.25:
                run.radius = 0.5 * max(reach, 0.1 * run.radius)
            return
        run.hold_violated(trial)
        if attempt < CORRECTIONS and np.isfinite(cost):
            shifted = (
                programme.values(programme.pack(trial))
                - jacobian @ np.r_[step.move, np.zeros(programme.concession_count)]
            )
            corrected = _quadratic_step(run, programme, model, gradient, jacobian, shifted)
            if corrected is not None:
                step = replace(corrected, predicted=step.predicted)
                continue
        break
    run.radius = 0.3 * min(run.radius, float(np.abs(step.move).max(initial=0.0)) + 1e-12)


def _at(run: Run, programme: Programme, move: Floats) -> tuple[Floats, float, dict[str, float]]:
    trial = run.values.copy()
    trial[programme.free] += move
    cost = run.task.cost.value(run.task.unknowns.state(trial))
    return trial, cost, run.task.breaches(trial)


def _sparse(programme: Programme, x: Floats) -> sparse.csc_matrix:
    row, column = programme.jacobian_pattern
    return sparse.csc_matrix(
        (programme.jacobian(x), (row, column)), shape=(programme.rows, programme.size)
    )


def _kkt(
    run: Run, programme: Programme, gradient: Floats, jacobian: sparse.csc_matrix, weights: Floats
) -> float:
    """Largest entry of the Lagrangian's gradient along the free unknowns not held by a bound."""
    free = len(programme.free)
    residual = (gradient + jacobian.T @ weights)[:free]
    low, high = (b[:free] for b in programme.bounds)
    here = run.values[programme.free]
    residual = np.where((here <= low + 1e-9) & (residual > 0.0), 0.0, residual)
    residual = np.where((here >= high - 1e-9) & (residual < 0.0), 0.0, residual)
    return float(np.abs(residual).max(initial=0.0))
