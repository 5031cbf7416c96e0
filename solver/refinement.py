"""The last digits: the winner of all starts solved to tight optimality conditions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from common.progress import CancelToken
from geometry.arrays import Floats
from solver.constraints.builders.coverage import cut_constraints
from solver.coverage.cuts import VisibilityCuts, cuts_for_hidden, opening_directions
from solver.coverage.views import FAR, NOWHERE, Views, holding_scarce, views, with_points
from solver.formulation import COVERAGE, candidate_constraints, covariance_cost, unknown_bounds
from solver.nlp.program import NonlinearProgram
from solver.nlp.quadratic import stationarity
from solver.nlp.sqp import Outcome, minimise
from solver.outer_loop import StartResult
from solver.problem import Problem

_RADIUS = 0.02
_MAX_STEPS, _MAX_ROUGH_STEPS, _MAX_NEAR_STEPS = 120, 25, 60
_PASSES = 3
_TIGHT, _TIGHT_NEAR = 1e-6, 3e-5
"""Errors of the optimality conditions to end with. Of many views held each, the rows bend so often
that more digits take as many steps again."""
_GAIN, _ROUGH_GAIN = 1e-13, 1e-5
"""Of three steps, at which a pass ends: what another pass will change needs no last digits."""


HOPELESS_COST = 1.03
"""Whose cost grows by more while points that came into view are framed ends nowhere better."""


def refine(problem: Problem, result: StartResult, cancel: CancelToken) -> Outcome:
    """Solve to the optimality conditions from where a start ended, with the same assignment.

    What goes hidden or comes into view on the way is held on to in another pass, as long as that
    costs no more than :data:`HOPELESS_COST` of what it began with.
    """
    with threadpool_limits(1):
        problem, values = with_points(problem, result.added_points), result.values
        state = problem.unknowns.state(values)
        seen = _views(problem, result)
        opening = opening_directions(problem, state, seen.assigned)
        cuts = VisibilityCuts.none()
        found, known = values, None
        rough = result.reach != FAR
        tolerance, most_steps = (_TIGHT_NEAR, _MAX_NEAR_STEPS) if rough else (_TIGHT, _MAX_STEPS)
        for k in range(_PASSES):
            rough = rough and k + 1 < _PASSES
            program = _program(problem, values, seen, cuts)
            outcome = _pass(program, found, known, tolerance, rough, most_steps, cancel)
            found, known = outcome.values, outcome.multipliers
            after = problem.unknowns.state(found)
            lost = cuts_for_hidden(problem, after, seen.assigned, opening)
            entered = _entered(problem, found, seen, result)
            clean = len(lost.camera) == 0 and entered is None
            if outcome.stopped or (clean and not rough) or _hopeless(program, result, outcome):
                break
            rough = rough and not clean
            cuts = cuts.joined(lost)
            if entered is not None:
                # Other points are framed, so the rows are others, too.
                seen, known = entered, None
        return outcome


def _pass(
    program: NonlinearProgram,
    values: Floats,
    known: list[Floats] | None,
    tolerance: float,
    rough: bool,
    most_steps: int,
    cancel: CancelToken,
) -> Outcome:
    return minimise(
        program,
        values,
        lambda *_: not cancel.is_set(),
        tolerance=tolerance,
        gain_tolerance=_ROUGH_GAIN if rough else _GAIN,
        known=known,
        max_iterations=_MAX_ROUGH_STEPS if rough else most_steps,
        radius=_RADIUS,
    )


def _hopeless(program: NonlinearProgram, result: StartResult, outcome: Outcome) -> bool:
    """Whether a network that held its limits is made to hold others at too high a price."""
    before, after = (program.unknowns.state(v) for v in (result.values, outcome.values))
    dearer = program.cost.value(after) > HOPELESS_COST * program.cost.value(before)
    return dearer and result.merit.feasible


def optimality_error(problem: Problem, result: StartResult) -> float:
    """How far from an optimum a start ended: the error of the optimality conditions there."""
    with threadpool_limits(1):
        problem = with_points(problem, result.added_points)
        seen = _views(problem, result)
        program = _program(problem, result.values, seen, VisibilityCuts.none())
        return stationarity(program, result.values)


def _views(problem: Problem, result: StartResult) -> Views:
    """What is seen and promised where a start ended."""
    state = problem.unknowns.state(result.values)
    seen = views(problem, state, None, result.margins, result.reach)
    # A solve that may lose views ends where they are lost, which is no optimum of anything.
    return seen if result.reach == FAR else holding_scarce(problem, seen, problem.count)


def _program(
    problem: Problem, values: Floats, seen: Views, cuts: VisibilityCuts
) -> NonlinearProgram:
    """Rays frozen as they are at ``values`` (7 n,), where the cost is scaled to be of order one."""
    state = problem.unknowns.state(values)
    cost = covariance_cost(problem, seen, covariance_cost(problem, seen).typical(state))
    rows = candidate_constraints(problem, state, seen) + cut_constraints(problem, cuts)
    bounds = unknown_bounds(problem, problem.anchor_values())
    return NonlinearProgram(problem.unknowns, cost, rows, bounds, COVERAGE)


def _entered(problem: Problem, values: Floats, seen: Views, result: StartResult) -> Views | None:
    """The views with points framed that came into view at ``values``; None if none did."""
    if result.reach == FAR:
        return None
    state = problem.unknowns.state(values)
    now = views(problem, state, None, result.margins, NOWHERE).framed
    if not np.any(now & ~seen.framed):
        return None
    return replace(seen, framed=seen.framed | now)
