"""The last digits: the winner of all starts solved to tight optimality conditions."""

from __future__ import annotations

from threadpoolctl import threadpool_limits

from common.progress import CancelToken
from solver.constraints.builders.coverage import cut_constraints
from solver.coverage.cuts import VisibilityCuts, cuts_for_hidden, opening_directions
from solver.coverage.views import FAR, views, with_points
from solver.formulation import COVERAGE, candidate_constraints, covariance_cost, unknown_bounds
from solver.nlp.program import NonlinearProgram
from solver.nlp.sqp import Outcome, minimise
from solver.outer_loop import StartResult
from solver.problem import Problem

_RADIUS = 0.02
_MAX_STEPS = 120
_MAX_STEPS_NEAR = 40
_TIGHT = 1e-6


def refine(problem: Problem, result: StartResult, cancel: CancelToken) -> Outcome:
    """Solve to the optimality conditions from where a start ended, with the same assignment."""
    with threadpool_limits(1):
        problem, values = with_points(problem, result.added_points), result.values
        state = problem.unknowns.state(values)
        seen = views(problem, state, None, result.margins, result.reach)
        opening = opening_directions(problem, state, seen.assigned)
        cost = covariance_cost(problem, seen, covariance_cost(problem, seen).typical(state))
        rows = candidate_constraints(problem, state, seen)
        bounds = unknown_bounds(problem, problem.anchor_values())
        cuts = VisibilityCuts.none()
        found, known = values, None
        for _ in range(3):
            program = NonlinearProgram(
                problem.unknowns, cost, rows + cut_constraints(problem, cuts), bounds, COVERAGE
            )
            outcome = minimise(
                program,
                found,
                lambda *_: not cancel.is_set(),
                tolerance=_TIGHT,
                gain_tolerance=1e-13,
                known=known,
                max_iterations=_MAX_STEPS if result.reach == FAR else _MAX_STEPS_NEAR,
                radius=_RADIUS,
            )
            found, known = outcome.values, outcome.multipliers
            lost = cuts_for_hidden(problem, problem.unknowns.state(found), seen.assigned, opening)
            if outcome.stopped or len(lost.camera) == 0:
                break
            cuts = cuts.joined(lost)
        return outcome
