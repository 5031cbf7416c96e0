"""Three solvers on one programme: ours, COIN-OR IPOPT and SciPy's SLSQP."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rigs

from benchmarks.engines import solve_ipopt, solve_slsqp
from solver.coverage.visibilitycuts import views
from solver.limits import Coverage, MotionBox
from solver.nlp.iterate import Task
from solver.nlp.program import Programme
from solver.nlp.sqp import minimise
from solver.outerloop import all_candidates, covariance_cost, unknown_bounds
from solver.problem import Scene

# The promise of agreement in docs/decisions: one part in a thousand of the cost.
AGREE = 1e-3


def go_on(*_: float) -> bool:
    return True


def task_of(scene: Scene) -> tuple[Task, np.ndarray]:
    values = scene.start_values()
    state = scene.unknowns.state(values)
    seen = views(scene, state)
    cost = covariance_cost(scene, seen, covariance_cost(scene, seen).typical(state))
    bounds = unknown_bounds(scene, values)
    return Task(scene.unknowns, cost, all_candidates(scene, state, seen), bounds), values


def face_scene() -> Scene:
    subject = rigs.face(60, 150)
    limits = rigs.face_limits(coverage=Coverage(), motion=MotionBox(x_mm=10.0, z_mm=10.0))
    return Scene(subject, rigs.face_cameras(subject, 4, limits), limits)


def wall_scene() -> Scene:
    return Scene(rigs.wall(), rigs.wall_cameras(rigs.WALL_START), rigs.wall_limits())


@pytest.mark.parametrize("make", [face_scene, wall_scene])
@pytest.mark.slow
def test_ipopt_confirms_our_optimum(make: object) -> None:
    task, values = task_of(make())  # type: ignore[operator]
    ours = minimise(task, values, go_on, tolerance=1e-8, gain_tolerance=0.0)
    assert ours.converged
    assert ours.violation < 1e-8
    blocks = tuple(r.block for r in task.rows)
    programme = Programme(task.unknowns, task.cost, blocks, *task.bounds, ours.values)
    theirs = solve_ipopt(programme, programme.pack(ours.values), go_on)
    assert theirs.success
    mine = task.cost.value(task.unknowns.state(ours.values))
    # Started at our optimum with every row in place, IPOPT finds nothing better.
    assert programme.objective(theirs.variables) == pytest.approx(mine, rel=AGREE)


def test_slsqp_confirms_our_optimum() -> None:
    task, values = task_of(wall_scene())
    ours = minimise(task, values, go_on, tolerance=1e-8, gain_tolerance=0.0)
    blocks = tuple(r.block for r in task.rows)
    programme = Programme(task.unknowns, task.cost, blocks, *task.bounds, ours.values)
    theirs = solve_slsqp(programme, programme.pack(ours.values), go_on)
    mine = task.cost.value(task.unknowns.state(ours.values))
    assert programme.objective(theirs.variables) == pytest.approx(mine, rel=AGREE)


def test_a_step_can_be_stopped() -> None:
    task, values = task_of(wall_scene())
    outcome = minimise(task, values, lambda iteration, *_: iteration < 3)
    assert outcome.stopped
    assert outcome.iterations == 3


def test_contradicting_rows_end_with_the_least_breach() -> None:
    scene = wall_scene()
    limits = replace(scene.limits, base_height=replace(scene.limits.base_height, mean_min=1.5))
    task, values = task_of(replace(scene, limits=limits))
    outcome = minimise(task, values, go_on)
    assert outcome.violation > 0.01
    assert np.isfinite(outcome.values).all()
