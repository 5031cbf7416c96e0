"""Three solvers on one programme: ours, COIN-OR IPOPT and SciPy's SLSQP."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rigs

from benchmarks.engines import solve_ipopt, solve_slsqp
from solver.coverage.views import views
from solver.limits import Coverage, MotionBox
from solver.nlp.program import NonlinearProgram
from solver.nlp.sqp import minimise
from solver.nlp.working_program import WorkingProgram
from solver.outer_loop import candidate_constraints, covariance_cost, unknown_bounds
from solver.problem import Problem

# The promise of agreement in docs/explanation/decisions: one part in a thousand of the cost.
AGREE = 1e-3


def go_on(*_: float) -> bool:
    return True


def program_of(problem: Problem) -> tuple[NonlinearProgram, np.ndarray]:
    values = problem.start_values()
    state = problem.unknowns.state(values)
    seen = views(problem, state)
    cost = covariance_cost(problem, seen, covariance_cost(problem, seen).typical(state))
    bounds = unknown_bounds(problem, values)
    return NonlinearProgram(
        problem.unknowns, cost, candidate_constraints(problem, state, seen), bounds
    ), values


def face_problem() -> Problem:
    subject = rigs.face(60, 150)
    limits = rigs.face_limits(coverage=Coverage(), motion=MotionBox(x_mm=10.0, z_mm=10.0))
    return Problem(subject, rigs.face_cameras(subject, 4, limits), limits)


def wall_problem() -> Problem:
    return Problem(rigs.wall(), rigs.wall_cameras(rigs.WALL_START), rigs.wall_limits())


@pytest.mark.parametrize("make", [face_problem, wall_problem])
@pytest.mark.slow
def test_ipopt_confirms_our_optimum(make: object) -> None:
    program, values = program_of(make())
    ours = minimise(program, values, go_on, tolerance=1e-8, gain_tolerance=0.0)
    assert ours.converged
    assert ours.violation < 1e-8
    blocks = tuple(r.block for r in program.rows)
    working = WorkingProgram(program.unknowns, program.cost, blocks, *program.bounds, ours.values)
    theirs = solve_ipopt(working, working.pack(ours.values), go_on)
    assert theirs.success
    mine = program.cost.value(program.unknowns.state(ours.values))
    # Started at our optimum with every row in place, IPOPT finds nothing better.
    assert working.objective(theirs.variables) == pytest.approx(mine, rel=AGREE)


def test_slsqp_confirms_our_optimum() -> None:
    program, values = program_of(wall_problem())
    ours = minimise(program, values, go_on, tolerance=1e-8, gain_tolerance=0.0)
    blocks = tuple(r.block for r in program.rows)
    working = WorkingProgram(program.unknowns, program.cost, blocks, *program.bounds, ours.values)
    theirs = solve_slsqp(working, working.pack(ours.values), go_on)
    mine = program.cost.value(program.unknowns.state(ours.values))
    assert working.objective(theirs.variables) == pytest.approx(mine, rel=AGREE)


def test_a_step_can_be_stopped() -> None:
    program, values = program_of(wall_problem())
    outcome = minimise(program, values, lambda iteration, *_: iteration < 3)
    assert outcome.stopped
    assert outcome.iterations == 3


def test_contradicting_rows_end_with_the_least_breach() -> None:
    problem = wall_problem()
    limits = replace(problem.limits, base_height=replace(problem.limits.base_height, mean_min=1.5))
    program, values = program_of(replace(problem, limits=limits))
    outcome = minimise(program, values, go_on)
    assert outcome.violation > 0.01
    assert np.isfinite(outcome.values).all()
