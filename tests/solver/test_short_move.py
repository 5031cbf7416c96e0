"""Short moves: the network meets its own program, and what goes wrong is held on to."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import rigs

from common.progress import NeverCancelled
from solver.coverage.cuts import opening_directions
from solver.coverage.hidden import kept_hidden
from solver.coverage.views import NOWHERE, framed_at, in_frame, views
from solver.formulation import cost_scale, unknown_bounds
from solver.limits import BaseHeight, Coverage, CoverageTier
from solver.near_optimum import run_near
from solver.outer_loop import StartResult
from solver.problem import Problem
from solver.quality import evaluate, is_sharp
from solver.refinement import optimality_error, refine
from solver.short_move import MARGINS, Effort, Held, Moved, _Frozen, short_move

NEVER = NeverCancelled()
EFFORT = Effort(half=0.1, tolerance=1e-4, gain=1e-5, steps=25)


@cache
def solved() -> tuple[Problem, StartResult]:
    subject = rigs.face(40, 90)
    limits = rigs.face_limits(
        coverage=Coverage((CoverageTier(2, 0.85),)), base_height=BaseHeight(min=0.1)
    )
    problem = Problem(subject, rigs.face_cameras(subject, 3, limits), limits)
    return problem, run_near(problem, lambda *_: None, NEVER)


@cache
def moved_on() -> tuple[Problem, np.ndarray, Moved]:
    """A network before the end, and the move from there with nothing held on to."""
    problem, result = solved()
    values = 0.7 * result.values + 0.3 * problem.start_values()
    bounds, scale = unknown_bounds(problem, values), cost_scale(problem, values)
    held = Held.of(framed_at(problem, problem.unknowns.state(values)))
    args = (problem, values, held, EFFORT, bounds, scale, lambda *_: True)
    return problem, values, short_move(*args)


def test_a_network_meets_the_rows_that_it_is_given() -> None:
    problem, values, moved = moved_on()
    bounds, scale = unknown_bounds(problem, values), cost_scale(problem, values)
    frozen = _Frozen.at(problem, values, moved.held.named, NOWHERE, bounds, scale)
    seen = framed_at(problem, frozen.state)
    aside = values + 0.2 * np.random.default_rng(0).normal(size=len(values))
    after = problem.unknowns.state(aside)
    camera, point = np.nonzero(framed_at(problem, after) & ~seen)
    assert len(camera) > 5
    hidden = kept_hidden(problem, frozen.state, after, camera, point)
    before = frozen.program(Held.of(seen)).violations(values)
    now = frozen.program(replace(moved.held, framed=seen, hidden=hidden)).violations(values)
    assert now == {family: pytest.approx(v, abs=1e-12) for family, v in before.items()}
    broken = frozen.program(replace(moved.held, framed=seen, hidden=hidden)).violations(aside)
    assert broken["coverage"] > frozen.program(Held.of(seen)).violations(aside)["coverage"]


def test_what_comes_into_view_is_framed_where_the_network_could_have_framed_it() -> None:
    problem, values, _ = moved_on()
    bounds, scale = unknown_bounds(problem, values), cost_scale(problem, values)
    frozen = _Frozen.at(problem, values, np.zeros(0, np.int64), NOWHERE, bounds, scale)
    seen = framed_at(problem, frozen.state)
    aside = values + 0.2 * np.random.default_rng(0).normal(size=len(values))
    open_mm = opening_directions(frozen.problem, frozen.state, frozen.seen.assigned)
    held, news = frozen.learned(aside, Held.of(seen), open_mm)
    came = framed_at(problem, problem.unknowns.state(aside)) & ~seen
    assert news
    fits = np.zeros_like(came)
    for k, camera in enumerate(problem.placed(values)):
        points_mm = problem.subject.check_points.points_mm
        fits[k] = in_frame(camera, points_mm, problem.limits.frame.margin_px)
        fits[k] &= is_sharp(camera, camera.pose.to_camera(points_mm)[:, 2])
    assert (came & fits).any()
    assert (came & ~fits).any()
    np.testing.assert_array_equal(held.framed, seen | (came & fits))
    out = np.zeros_like(came)
    out[held.hidden.camera, held.hidden.point] = True
    np.testing.assert_array_equal(out, came & ~fits)


def test_a_clean_move_loses_no_view_and_lets_nothing_into_view() -> None:
    problem, values, moved = moved_on()
    assert moved.clean
    before = views(problem, problem.unknowns.state(values), None, MARGINS, NOWHERE)
    state = problem.unknowns.state(moved.outcome.values)
    after = views(problem, state, None, MARGINS, NOWHERE)
    assert not (before.seen & ~after.seen).any()
    assert not (framed_at(problem, state) & ~moved.held.framed).any()


def test_a_box_that_ends_a_move_says_so() -> None:
    problem, values, moved = moved_on()
    bounds, scale = unknown_bounds(problem, values), cost_scale(problem, values)
    small = replace(EFFORT, half=1e-3)
    held = Held.of(framed_at(problem, problem.unknowns.state(values)))
    short = short_move(problem, values, held, small, bounds, scale, lambda *_: True)
    assert short.edge
    assert short.size == pytest.approx(1e-3)
    assert moved.size > 1e-3


def test_a_network_that_was_moved_is_refined_to_its_optimality_conditions() -> None:
    problem, result = solved()
    outcome = refine(problem, result, NEVER)
    assert outcome.kkt_error < 1e-4
    refined = evaluate(problem.subject, problem.placed(outcome.values), problem.limits)
    rough = evaluate(problem.subject, problem.placed(result.values), problem.limits)
    assert refined.feasible
    assert refined.cost_mm2 <= rough.cost_mm2 * (1.0 + 1e-3)
    # What is held on to belongs to the conditions: without it the end looks far from an optimum.
    at_end = replace(result, values=outcome.values)
    assert optimality_error(problem, at_end) < 1e-2
