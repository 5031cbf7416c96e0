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
_MAX_STEPS = 120
_MAX_STEPS_NEAR = 40
_PASSES = 3
_TIGHT = 1e-6


def refine(problem: Problem, result: StartResult, cancel: CancelToken) -> Outcome:
    """Solve to the optimality conditions from where a start ended, with the same assignment.

    What goes hidden or comes into view on the way is held on to in another pass.
    """
    with threadpool_limits(1):
        problem, values = with_points(problem, result.added_points), result.values
        state = problem.unknowns.state(values)
        seen = _views(problem, result)
        opening = opening_directions(problem, state, seen.assigned)
        cuts = VisibilityCuts.none()
        found, known = values, None
        for _ in range(_PASSES):
            outcome = minimise(
                _program(problem, values, seen, cuts),
                found,
                lambda *_: not cancel.is_set(),
                tolerance=_TIGHT,
                gain_tolerance=1e-13,
                known=known,
                max_iterations=_MAX_STEPS if result.reach == FAR else _MAX_STEPS_NEAR,
                radius=_RADIUS,
            )
            found, known = outcome.values, outcome.multipliers
            after = problem.unknowns.state(found)
            lost = cuts_for_hidden(problem, after, seen.assigned, opening)
            entered = _entered(problem, found, seen, result)
            if outcome.stopped or (len(lost.camera) == 0 and entered is None):
                break
            cuts = cuts.joined(lost)
            if entered is not None:
                # Other points are framed, so the rows are others, too.
                seen, known = entered, None
        return outcome


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
    return seen if result.reach == FAR else holding_scarce(problem, seen)


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
