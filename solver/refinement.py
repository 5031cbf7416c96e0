"""The last digits: the winner of all starts solved to tight optimality conditions."""

from __future__ import annotations

from dataclasses import replace

from threadpoolctl import threadpool_limits

from common.progress import CancelToken
from geometry.arrays import Floats
from solver.constraints.builders.coverage import cut_constraints
from solver.coverage.cuts import VisibilityCuts, cuts_for_hidden, opening_directions
from solver.coverage.views import Views, views, with_points
from solver.formulation import (
    COVERAGE,
    candidate_constraints,
    cost_scale,
    covariance_cost,
    unknown_bounds,
)
from solver.nlp.program import NonlinearProgram
from solver.nlp.quadratic import stationarity
from solver.nlp.sqp import Outcome, minimise
from solver.outer_loop import StartResult
from solver.problem import Problem
from solver.short_move import Effort, Held, short_move
from solver.short_move import optimality_error as error_with

_RADIUS = 0.02
_MAX_STEPS = 120
_PASSES = 3
_TIGHT, _GAIN = 1e-6, 1e-13

_LAST_MOVE = Effort(half=0.3, tolerance=3e-5, gain=1e-9, steps=60)
"""Of many views held each, the rows bend so often that more digits take as many steps again."""


def refine(problem: Problem, result: StartResult, cancel: CancelToken) -> Outcome:
    """Solve to the optimality conditions from where a start ended, with the same assignment.

    A network that was moved shortly makes one more move, which ends where its conditions hold.
    """
    with threadpool_limits(1):
        if result.held is not None:
            return _last_move(problem, result, result.held, cancel)
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
                gain_tolerance=_GAIN,
                known=known,
                max_iterations=_MAX_STEPS,
                radius=_RADIUS,
            )
            found, known = outcome.values, outcome.multipliers
            lost = cuts_for_hidden(problem, problem.unknowns.state(found), seen.assigned, opening)
            if outcome.stopped or len(lost.camera) == 0:
                break
            cuts = cuts.joined(lost)
        return outcome


def _last_move(problem: Problem, result: StartResult, held: Held, cancel: CancelToken) -> Outcome:
    bounds = unknown_bounds(problem, problem.anchor_values())
    scale = cost_scale(problem, result.values)
    moved = short_move(
        problem, result.values, held, _LAST_MOVE, bounds, scale, lambda *_: not cancel.is_set()
    )
    if not moved.edge:
        return moved.outcome
    # What the box holds is not at rest.
    values = moved.outcome.values
    error = error_with(problem, values, moved.held.seeing(held.framed), bounds, scale)
    return replace(moved.outcome, kkt_error=error)


def optimality_error(problem: Problem, result: StartResult) -> float:
    """How far from an optimum a start ended: the error of the optimality conditions there."""
    with threadpool_limits(1):
        if result.held is not None:
            bounds = unknown_bounds(problem, problem.anchor_values())
            scale = cost_scale(problem, result.values)
            return error_with(problem, result.values, result.held, bounds, scale)
        problem = with_points(problem, result.added_points)
        seen = _views(problem, result)
        program = _program(problem, result.values, seen, VisibilityCuts.none())
        return stationarity(program, result.values)


def _views(problem: Problem, result: StartResult) -> Views:
    """What is seen and promised where a start ended."""
    state = problem.unknowns.state(result.values)
    return views(problem, state, None, result.margins, result.reach)


def _program(
    problem: Problem, values: Floats, seen: Views, cuts: VisibilityCuts
) -> NonlinearProgram:
    """Rays frozen as they are at ``values`` (7 n,), where the cost is scaled to be of order one."""
    state = problem.unknowns.state(values)
    cost = covariance_cost(problem, seen, covariance_cost(problem, seen).typical(state))
    rows = candidate_constraints(problem, state, seen) + cut_constraints(problem, cuts)
    bounds = unknown_bounds(problem, problem.anchor_values())
    return NonlinearProgram(problem.unknowns, cost, rows, bounds, COVERAGE)
