"""Short moves from a good network: what counts as better, how far they go, what they never lose."""

from __future__ import annotations

import threading
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import rigs
from hypothesis import given, settings
from hypothesis import strategies as st

from common.progress import NeverCancelled
from geometry.arrays import Floats
from solver import near_optimum
from solver.coverage.views import NEAR, judge
from solver.formulation import Merit, unknown_bounds
from solver.limits import BaseHeight, Coverage, CoverageTier, PoseBounds
from solver.near_optimum import FIRST_BOX, LARGEST_BOX, MAX_MOVES, run_near
from solver.nlp.sqp import Outcome
from solver.outer_loop import StartResult
from solver.problem import Problem
from solver.quality import evaluate
from solver.short_move import Effort, Held, Moved, box
from solver.variables import FOCUS, KAPPA, PER_CAMERA

NEVER = NeverCancelled()
SCALE = 2.0


def problem_of(count: int = 3, **changes: object) -> Problem:
    subject = rigs.face(40, 90)
    limits = rigs.face_limits(
        **{"coverage": Coverage((CoverageTier(2, 0.85),)), "base_height": BaseHeight(min=0.1)}
        | changes
    )
    return Problem(subject, rigs.face_cameras(subject, count, limits), limits)


@cache
def solved() -> tuple[Problem, StartResult, tuple[tuple[float, ...], ...]]:
    problem, told = problem_of(), []
    result = run_near(problem, lambda *step: told.append(step), NEVER)
    return problem, result, tuple(told)


# --- what is better ---------------------------------------------------------------------------

sizes = st.floats(0.0, 10.0)
merits = st.builds(Merit, st.one_of(st.just(0.0), sizes), st.one_of(st.just(0.0), sizes), sizes)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(merits, merits, merits)
def test_better_is_an_order(one: Merit, two: Merit, three: Merit) -> None:
    better = near_optimum._better
    assert not better(one, one, SCALE)
    assert not (better(one, two, SCALE) and better(two, one, SCALE))
    if better(one, two, SCALE) and better(two, three, SCALE):
        assert better(one, three, SCALE)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(sizes, st.floats(1e-6, 1.0), st.floats(1e-6, 1.0))
def test_what_is_broken_costs_more_than_it_could_gain(
    cost: float, violation: float, shortfall: float
) -> None:
    whole = Merit(0.0, 0.0, cost)
    # A twentieth of the scale, and 300 or 3000 of it per unit of what is broken.
    for broken, charge in (
        (Merit(violation, 0.0, 0.0), 0.05 + 300.0 * violation),
        (Merit(0.0, shortfall, 0.0), 0.05 + 3000.0 * shortfall),
    ):
        dearer = replace(broken, cost=cost)
        assert near_optimum._better(whole, dearer, SCALE)
        assert not near_optimum._better(dearer, whole, SCALE)
        gains = replace(broken, cost=cost - SCALE * charge * 1.01)
        assert near_optimum._better(gains, whole, SCALE)


def test_rounding_breaks_nothing() -> None:
    assert near_optimum._better(Merit(0.9e-7, 0.0, 1.0), Merit(0.0, 0.0, 1.001), SCALE)
    assert not near_optimum._better(Merit(1.1e-7, 0.0, 1.0), Merit(0.0, 0.0, 1.001), SCALE)


# --- the box ----------------------------------------------------------------------------------


def test_a_move_stays_in_its_box_and_in_the_bounds_and_focus_and_roll_are_free() -> None:
    problem = problem_of(2, bounds=PoseBounds(x_mm=10.0))
    values = problem.start_values()
    bounds = unknown_bounds(problem, values)
    low, high = (b.reshape(2, PER_CAMERA) for b in box(values, 0.05, bounds))
    at = values.reshape(2, PER_CAMERA)
    np.testing.assert_allclose(high[:, 3] - at[:, 3], 10.0 / problem.length_mm)
    for column in (0, 1, 4, 5):
        np.testing.assert_allclose(high[:, column] - at[:, column], 0.05)
        np.testing.assert_allclose(at[:, column] - low[:, column], 0.05)
    assert np.isinf(high[:, [KAPPA, FOCUS]]).all()
    np.testing.assert_allclose(low[:, FOCUS] * problem.length_mm, 350.0)


# --- a network looked at ----------------------------------------------------------------------


def test_a_network_is_looked_at_with_the_check_points() -> None:
    problem = problem_of()
    values = problem.start_values()
    found = near_optimum._looked_at(problem, values, unknown_bounds(problem, values))
    quality = evaluate(problem.subject, problem.cameras, problem.limits)
    assert found.merit.cost * problem.length_mm**2 == pytest.approx(quality.cost_mm2, rel=1e-9)
    judged = judge(problem, problem.unknowns.state(values))
    assert found.merit.shortfall == judged.shortfall


def test_weak_are_the_points_that_losing_one_view_hurts_most() -> None:
    subject = rigs.face(20, 300)
    limits = rigs.face_limits(coverage=Coverage())
    problem = Problem(subject, rigs.face_cameras(subject, 3), limits)
    _, weak = near_optimum._checked(problem, problem.start_values())
    norm = evaluate(subject, problem.cameras, limits).points.norm_mm2
    loss = np.zeros(len(norm))
    for k in range(3):
        others = problem.cameras[:k] + problem.cameras[k + 1 :]
        loss = np.maximum(loss, evaluate(subject, others, limits).points.norm_mm2 - norm)
    assert len(weak) == near_optimum._MOST_WEAK
    assert loss[weak].min() >= np.delete(loss, weak).max() * (1.0 - 1e-6)


# --- the moves --------------------------------------------------------------------------------


def test_moves_end_feasible_and_better_by_the_evaluations_own_figures() -> None:
    problem, result, _ = solved()
    before = evaluate(problem.subject, problem.cameras, problem.limits)
    after = evaluate(problem.subject, problem.placed(result.values), problem.limits)
    assert after.feasible, after.violated
    assert not before.feasible or after.cost_mm2 < before.cost_mm2
    assert result.merit.feasible
    assert result.merit.cost * problem.length_mm**2 == pytest.approx(after.cost_mm2, rel=1e-6)
    assert result.reach is NEAR
    assert not result.stopped
    assert result.why
    assert 1 <= result.rounds <= MAX_MOVES


def test_a_second_run_from_the_end_is_never_worse_and_keeps_what_it_had() -> None:
    problem, result, _ = solved()
    again = Problem(problem.subject, problem.placed(result.values), problem.limits)
    first = evaluate(problem.subject, again.cameras, problem.limits)
    more = run_near(again, lambda *_: None, NEVER)
    second = evaluate(problem.subject, again.placed(more.values), problem.limits)
    assert second.feasible
    assert second.cost_mm2 <= first.cost_mm2 * (1.0 + 1e-9)
    # Whoever begins near the end has little to gain: one move of the first box at the most.
    assert second.cost_mm2 > 0.9 * first.cost_mm2


def test_progress_counts_moves_and_steps_up() -> None:
    _, result, told = solved()
    moves, steps = [t[0] for t in told], [t[1] for t in told]
    assert moves == sorted(moves)
    assert steps == sorted(steps)
    assert (moves[0], moves[-1]) == (1, result.rounds)
    assert steps[-1] == result.iterations


def test_a_cancelled_run_returns_its_start_and_says_so() -> None:
    problem, cancel = problem_of(2), threading.Event()
    cancel.set()
    result = run_near(problem, lambda *_: None, cancel)
    assert result.stopped
    assert result.why == "stopped by request"
    np.testing.assert_array_equal(result.values, problem.start_values())


def test_no_move_reaches_beyond_its_box(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, moves = problem_of(2, coverage=Coverage()), []
    whole = near_optimum.short_move

    def watched(
        problem: Problem, values: Floats, held: Held, effort: Effort, *more: object
    ) -> Moved:
        found = whole(problem, values, held, effort, *more)
        moved = np.abs(found.outcome.values - values).reshape(-1, PER_CAMERA)
        assert found.size == np.delete(moved, [KAPPA, FOCUS], axis=1).max()
        moves.append((effort.half, found.size))
        return found

    monkeypatch.setattr(near_optimum, "short_move", watched)
    run_near(problem, lambda *_: None, NEVER)
    assert moves[0][0] == FIRST_BOX
    for half, size in moves:
        assert size <= half + 1e-9
        assert half <= LARGEST_BOX
    # A good move doubles the next box; a bad one leaves two fifths of how far it went.
    for (before, went), (after, _) in pairwise(moves):
        assert after == pytest.approx(min(2.0 * before, LARGEST_BOX)) or after == pytest.approx(
            0.4 * min(before, went)
        )


def test_a_move_that_is_worse_names_the_points_that_it_worsened(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem, told = problem_of(), []
    start = problem.start_values()
    begin = near_optimum._looked_at(problem, start, unknown_bounds(problem, start))
    each = begin.each.copy()
    each[[7, 31]] *= 3.0
    each[50] *= 0.5
    missed = replace(begin.judged, missed=np.array([12]))
    worse = replace(begin, merit=Merit(0.0, 0.0, 2.0 * begin.merit.cost), each=each, judged=missed)
    looks = iter((begin, *[worse] * MAX_MOVES))

    def moved(_problem: Problem, values: Floats, held: Held, effort: Effort, *_: object) -> Moved:
        told.append((held, effort))
        outcome = Outcome(values, [], 1.0, 0.0, 1, True, False, "")
        return Moved(outcome, held, clean=True, edge=False, size=effort.half)

    monkeypatch.setattr(near_optimum, "_looked_at", lambda *_: next(looks))
    monkeypatch.setattr(near_optimum, "short_move", moved)
    result = run_near(problem, lambda *_: None, NEVER)
    (first, _), (second, _) = told[:2]
    assert np.setdiff1d(second.named, first.named).tolist() == sorted(
        {7, 12, 31} - set(begin.weak.tolist())
    )
    np.testing.assert_array_equal(result.values, start)
    assert result.why == "no move in reach improves the network any further"
