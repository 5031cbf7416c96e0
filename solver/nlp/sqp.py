"""Sequential quadratic programming with exact second derivatives and constraint exchange.

Each step solves a quadratic model of the cost under the linearised rows inside a trust region;
the quadratic program goes to PIQP, a proximal interior-point solver. Compared with handing
each working set to a general interior-point solver, rows can join at every step and nothing is
lost when they do: interior points cannot start warm, and exchange is nothing but restarts.

Every family of rows may be relaxed at a penalty, so a step exists even where the linearised rows
contradict each other: an exact penalty on the family's worst row, or on every row of the
families in which one that cannot be had must not excuse the others. Fletcher, Practical Methods
of Optimization, 2nd ed., section 14.4 (S l1 QP); second-order correction as there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Floats
from solver.nlp.iterate import FEASIBLE, Iterate, Point, WorkingSet
from solver.nlp.penalty import LARGEST_PENALTY
from solver.nlp.program import NonlinearProgram
from solver.nlp.quadratic import Linearised, Step, quadratic_step

Watch = Callable[[int, float, float], bool]
"""Called with iteration, cost and violation; returns False to stop."""

FIRST_RADIUS = 0.2
"""First trust radius, in length scales and radians: about 11 degrees round the subject."""

LARGEST_RADIUS = 0.5
SMALLEST_RADIUS = 1e-9
FIRST_PENALTY = 50.0

CORRECTIONS = 3
"""Most second-order corrections of a step. Each costs a small part of what a new step costs, and
rows that bend let a step be as long as the model holds, not as the rows are straight."""

SETTLING = 0.01
"""Steps shorter than this are taken among rows that will bind at the solution."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """Where a solve ended.

    ``values`` (7 n,) all unknowns; ``multipliers`` one array per block of candidate rows, with
    ``L = f + sum multipliers . rows``; ``violation`` the worst violation of any candidate row;
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


@dataclass(frozen=True)
class _Goal:
    """When a solve may end: the error of the optimality conditions, the gain of three steps."""

    kkt_error: float
    gain: float

    def reached(self, iterate: Iterate, kkt: float) -> str | None:
        """Why the iterate is good enough, or None."""
        worst = iterate.worst
        if kkt < self.kkt_error and worst < FEASIBLE and not iterate.unpaid:
            return "the optimality conditions hold to the tolerance"
        if worst < max(FEASIBLE, 0.005 * self.gain) and _idle(iterate.gains, self.gain):
            return f"three steps together gained less than {self.gain:g} of the cost"
        return None


def minimise(
    program: NonlinearProgram,
    start: Floats,
    watch: Watch,
    *,
    tolerance: float = 1e-7,
    gain_tolerance: float = 1e-9,
    known: list[Floats] | None = None,
    max_iterations: int = 200,
    penalty: float = FIRST_PENALTY,
    radius: float = FIRST_RADIUS,
) -> Outcome:
    """Minimise from ``start`` (7 n,).

    Stops when the optimality conditions hold to ``tolerance``, or when the last three steps
    were feasible and together gained less than ``gain_tolerance``. ``known`` multipliers of an
    earlier solve of the same rows, to which others may have been added at the end, speed it up;
    ``radius`` is the first trust radius and ``penalty`` the first penalty of a violation.
    """
    goal = _Goal(tolerance, gain_tolerance)
    iterate = Iterate.first(program, start, known, penalty, radius)
    kkt, why, converged, stopped, iteration = np.inf, "", False, False, 0
    for iteration in range(max_iterations + 1):
        if not watch(iteration, iterate.point.cost, iterate.worst):
            stopped, why = True, "stopped by request"
            break
        rows = iterate.working_set()
        local = Linearised.at(rows.program, iterate.point.values)
        weights = _weights(iterate, rows)
        kkt = local.kkt_error(weights)
        reached = goal.reached(iterate, kkt)
        if reached is not None:
            converged, why = True, reached
            break
        if iterate.radius < SMALLEST_RADIUS:
            if iterate.worst < FEASIBLE or iterate.penalty.weight >= LARGEST_PENALTY:
                why = "no step in reach improves the network any further"
                break
            iterate = replace(iterate, penalty=iterate.penalty.raised(), radius=0.01)
            continue
        if iteration == max_iterations:
            why = "the limit of iterations was reached"
            break
        iterate = _advance(iterate, rows, local, weights)
    found = iterate.point.values, list(iterate.multipliers)
    return Outcome(*found, kkt, iterate.worst, iteration, converged, stopped, why)


def _weights(iterate: Iterate, rows: WorkingSet) -> Floats:
    """Multipliers of the working rows at the iterate."""
    known = zip(iterate.multipliers, rows.chosen, strict=True)
    return rows.program.from_blocks([m[c] for m, c in known])


def _idle(gains: Sequence[float], tolerance: float) -> bool:
    """Whether the last three steps together gained less than ``tolerance``."""
    return len(gains) > 2 and sum(gains[-3:]) < tolerance


def _advance(iterate: Iterate, rows: WorkingSet, local: Linearised, weights: Floats) -> Iterate:
    """The next iterate: a step taken if the merit falls as predicted, else a smaller region."""
    settling = iterate.worst < 1e-4 and iterate.step_size < SETTLING
    model = local.model(weights, settling)
    step = quadratic_step(iterate, local, model, local.values)
    if step is None:
        return replace(iterate, radius=0.25 * iterate.radius)
    program, before = iterate.program, iterate.point.merit(iterate.program, iterate.penalty)
    noise = 1e-13 * max(1.0, abs(before))
    if step.predicted <= noise:
        return _nothing_to_gain(iterate, rows, step)
    predicted = step.predicted
    for attempt in range(1 + CORRECTIONS):
        trial = _moved(iterate, local, step)
        gain = -np.inf
        if np.isfinite(trial.cost):
            gain = before - trial.merit(program, iterate.penalty)
        ratio = (gain + noise) / (predicted + noise)
        if ratio > 0.05:
            return _accepted(iterate, rows, step, trial, gain, ratio)
        iterate = iterate.holding_violated(trial.values)
        if attempt == CORRECTIONS or not np.isfinite(trial.cost):
            break
        shifted = local.shifted(trial.values, step.move)
        corrected = quadratic_step(iterate, local, model, shifted)
        if corrected is None:
            break
        step = corrected
    size = float(np.abs(step.move).max(initial=0.0))
    return replace(iterate, radius=0.3 * min(iterate.radius, size + 1e-12))


def _nothing_to_gain(iterate: Iterate, rows: WorkingSet, step: Step) -> Iterate:
    """Where this penalty leaves nothing to gain; what is still violated needs a higher one."""
    penalty = iterate.penalty.raised() if iterate.worst > FEASIBLE else iterate.penalty
    return replace(
        iterate,
        multipliers=rows.multipliers(step.multipliers, iterate.multipliers),
        penalty=penalty,
        radius=0.25 * iterate.radius,
    )


def _moved(iterate: Iterate, local: Linearised, step: Step) -> Point:
    values = iterate.point.values.copy()
    values[local.working.free] += step.move
    return Point.at(iterate.program, values)


def _accepted(
    iterate: Iterate, rows: WorkingSet, step: Step, trial: Point, gain: float, ratio: float
) -> Iterate:
    """The iterate after a step; ``ratio`` of the gain to the predicted one sets the radius."""
    program, radius = iterate.program, iterate.radius
    size = float(np.abs(step.move).max(initial=0.0))
    if ratio > 0.7 and size > 0.8 * radius:
        radius = min(2.0 * radius, LARGEST_RADIUS)
    elif ratio < 0.25:
        radius = 0.5 * max(size, 0.1 * radius)
    multipliers = rows.multipliers(step.multipliers, iterate.multipliers)
    worst = program.worst(trial.violations)
    return replace(
        iterate,
        point=trial,
        radius=radius,
        penalty=iterate.penalty.after_step(program, multipliers, iterate.worst, step.left, worst),
        multipliers=multipliers,
        step_size=size,
        gains=(*iterate.gains, gain),
    )
