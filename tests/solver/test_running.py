"""Starts run in processes, the outer loop, refinement, contradictions: what is told and when."""

from __future__ import annotations

import os
import threading
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import rigs
from chatty import Chatty

from common.errors import CancelledError
from common.progress import NeverCancelled
from solver import infeasibility
from solver.coverage.views import judge, views
from solver.formulation import Merit, candidate_constraints, covariance_cost, merit, unknown_bounds
from solver.infeasibility import conflicts
from solver.limits import BaseHeight, Coverage, CoverageTier, Incidence, PoseBounds, StandOff
from solver.outer_loop import THINNED_POINTS, StartResult, run_start, thinned
from solver.pool import StartJob
from solver.problem import Problem
from solver.quality import evaluate
from solver.refinement import refine
from solver.variables import FOCUS, PER_CAMERA
from solver.workers import Workers, silent

NEVER = NeverCancelled()


def face_problem(count: int = 3, points: int = 60, **changes: object) -> Problem:
    subject = rigs.face(points, 150)
    limits = rigs.face_limits(
        **{"coverage": Coverage((CoverageTier(2, 0.9),)), "base_height": BaseHeight()} | changes
    )
    return Problem(subject, rigs.face_cameras(subject, count), limits)


@cache
def solved() -> tuple[Problem, StartResult]:
    problem = face_problem()
    return problem, run_start(problem, silent, NEVER)


# --- merit, bounds, cost ----------------------------------------------------------------------


def test_feasible_beats_infeasible_then_violation_then_cost() -> None:
    good, dear = Merit(0.0, 0.0, 1.0), Merit(1e-6, 0.0, 2.0)
    broken, worse = Merit(0.1, 0.0, 0.5), Merit(0.1, 0.1, 0.1)
    order = [good, dear, broken, worse]
    for k, better in enumerate(order):
        assert better.better_than(None)
        assert not better.better_than(better)
        for other in order[k + 1 :]:
            assert better.better_than(other)
            assert not other.better_than(better)
    assert not Merit(0.0, 0.01, 1.0).feasible
    assert not Merit(3e-6, 0.0, 1.0).feasible


def test_bounds_are_half_ranges_about_the_start_and_the_focus_range() -> None:
    box = PoseBounds(omega_deg=10.0, x_mm=50.0)
    problem = face_problem(2, bounds=box)
    start = problem.start_values()
    low, high = (b.reshape(2, PER_CAMERA) for b in unknown_bounds(problem, start))
    at = start.reshape(2, PER_CAMERA)
    np.testing.assert_allclose(np.degrees(high[:, 0] - at[:, 0]), 10.0)
    np.testing.assert_allclose((at[:, 3] - low[:, 3]) * problem.length_mm, 50.0)
    assert np.isinf(high[:, [1, 2, 4, 5]]).all()
    np.testing.assert_allclose(low[:, FOCUS] * problem.length_mm, 350.0)
    assert np.isinf(high[:, FOCUS]).all()


def test_the_cost_is_that_of_the_evaluation() -> None:
    # On the same points and with all rays in frame the two are computed apart.
    subject = rigs.face(150, 150)
    subject = replace(subject, design_points=subject.check_points)
    problem = Problem(subject, rigs.face_cameras(subject, 3), rigs.face_limits())
    state = problem.unknowns.state(problem.start_values())
    cost = covariance_cost(problem, views(problem, state)).value(state)
    quality = evaluate(subject, problem.cameras, problem.limits)
    assert quality.in_frame_share == 1.0
    assert cost * problem.length_mm**2 == pytest.approx(quality.cost_mm2, rel=1e-9)


def test_the_merit_sees_what_is_broken_and_what_is_out_of_bounds() -> None:
    problem = face_problem(2, bounds=PoseBounds(x_mm=50.0))
    values = problem.start_values()
    state = problem.unknowns.state(values)
    seen = views(problem, state)
    rows = candidate_constraints(problem, state, seen)
    bounds = unknown_bounds(problem, values)
    inside = merit(problem, values, seen, rows, bounds, 0.0)
    moved = values.copy()
    moved[3] += 90.0 / problem.length_mm
    outside = merit(problem, moved, seen, rows, bounds, 0.2)
    assert outside.violation >= 40.0 / problem.length_mm - 1e-12
    assert inside.violation < outside.violation
    assert outside.shortfall == 0.2


def test_constraints_of_coverage_join_those_of_rays_positions_and_bodies() -> None:
    problem = face_problem(3, base_height=BaseHeight(min=0.1))
    state = problem.unknowns.state(problem.start_values())
    families = [
        r.block.family for r in candidate_constraints(problem, state, views(problem, state))
    ]
    for family in ("frame", "depth_of_field", "coverage", "stand_off_min", "base_height_min"):
        assert families.count(family) == 1
    # Bodies this far apart are left to the check after each solve.
    assert "sight_line" in families
    assert "body_clearance" not in families


# --- the outer loop ---------------------------------------------------------------------------


def test_a_start_ends_feasible_and_better_than_it_began() -> None:
    problem, result = solved()
    assert result.merit.feasible
    before = evaluate(problem.subject, problem.cameras, problem.limits)
    after = evaluate(problem.subject, problem.placed(result.values), problem.limits)
    assert after.feasible, after.violated
    assert after.cost_mm2 < before.cost_mm2
    assert judge(problem, problem.unknowns.state(result.values)).shortfall == 0.0


def test_progress_counts_up() -> None:
    told: list[tuple[float, ...]] = []
    run_start(face_problem(2), lambda *step: told.append(step), NEVER)
    outer, steps = [t[0] for t in told], [t[1] for t in told]
    assert outer == sorted(outer)
    assert outer[0] == 1
    assert steps == sorted(steps)


def test_a_start_that_is_cancelled_says_so() -> None:
    cancel = threading.Event()
    cancel.set()
    result = run_start(face_problem(2), silent, cancel)
    assert result.stopped
    assert result.why == "stopped by request"


def test_large_subjects_are_thinned_at_first() -> None:
    assert thinned(face_problem(2), 0) is None
    problem = face_problem(2, points=2 * THINNED_POINTS + 50)
    found = thinned(problem, 3)
    assert found is not None
    few, chosen = found
    assert len(chosen) == len(few.subject.design_points) == THINNED_POINTS
    np.testing.assert_array_equal(
        few.subject.design_points.points_mm, problem.subject.design_points.points_mm[chosen]
    )
    assert len(set(chosen.tolist())) == THINNED_POINTS
    np.testing.assert_array_equal(few.origin_mm, problem.origin_mm)
    assert not np.array_equal(thinned(problem, 4)[1], chosen)


def test_refinement_meets_the_optimality_conditions() -> None:
    problem, result = solved()
    outcome = refine(problem, result, NEVER)
    assert outcome.kkt_error < 1e-6
    refined = evaluate(problem.subject, problem.placed(outcome.values), problem.limits)
    rough = evaluate(problem.subject, problem.placed(result.values), problem.limits)
    assert refined.cost_mm2 <= rough.cost_mm2 * (1.0 + 1e-3)


# --- processes --------------------------------------------------------------------------------


def jobs(count: int) -> list[StartJob]:
    subject = rigs.face(20, 30)
    limits = rigs.face_limits(coverage=Coverage(), base_height=BaseHeight(), depth_of_field=False)
    problem = Problem(subject, rigs.face_cameras(subject, 2), limits)
    return [StartJob(k, "test", problem, k) for k in range(count)]


@pytest.mark.slow
def test_results_come_in_the_order_of_their_jobs_whatever_the_workers() -> None:
    heard: list[int] = []
    here = Workers(1).run(jobs(2), lambda start, *_: heard.append(start), NEVER)
    assert set(heard) == {0, 1}
    heard.clear()
    with Workers(2) as workers:
        apart = workers.run(jobs(2), lambda start, *_: heard.append(start), NEVER)
    assert set(heard) <= {0, 1}
    assert len(here) == len(apart) == 2
    for one, other in zip(here, apart, strict=True):
        assert one.values.tobytes() == other.values.tobytes()


def test_what_a_job_tells_last_is_heard_by_no_later_batch() -> None:
    wrong = []
    with Workers(2) as workers:
        for batch in range(12):
            jobs = [Chatty(2 * batch), Chatty(2 * batch + 1)]
            mine = {job.index for job in jobs}
            found = workers.run(jobs, lambda job, *_, mine=mine: wrong.extend({job} - mine), NEVER)
            assert found == sorted(mine)
    assert wrong == []


@pytest.mark.slow
def test_cancelled_workers_raise_and_leave_the_environment_as_it_was() -> None:
    before = dict(os.environ)
    cancel = threading.Event()
    cancel.set()
    for count in (1, 2):
        with pytest.raises(CancelledError), Workers(count) as workers:
            workers.run(jobs(2), silent, cancel)
    assert dict(os.environ) == before


# --- contradictions ---------------------------------------------------------------------------


@pytest.mark.slow
def test_a_planted_contradiction_is_named_with_what_it_would_take() -> None:
    # 0.9 of base/height between all pairs cannot be had under 0.5 of it.
    problem = Problem(
        rigs.wall(),
        rigs.wall_cameras(rigs.WALL_START),
        rigs.wall_limits(
            base_height=BaseHeight(min=0.2), stand_off=StandOff(max_mm=10_000.0), centring=None
        ),
    )
    found = {c.family: c for c in conflicts(problem, problem.start_values(), NEVER)}
    # The wall is 39 m wide: from 10 m it does not fit into 66 degrees.
    assert {"stand_off_max", "frame"} <= set(found)
    assert found["stand_off_max"].unit == "mm"
    alone = found["stand_off_max"].amount_alone
    assert alone is not None
    # 19.5 m at tan 33 degrees, seen from straight ahead, need 30 m.
    assert 10_000.0 < alone < 40_000.0
    assert max(found["stand_off_max"].amount, found["frame"].amount) > 0.0
    # Base/height pushes back too, but giving way would not help.
    assert all(c.amount > 0.0 or c.amount_alone for c in found.values())


def test_what_gives_way_is_told_in_the_units_of_the_table_of_limits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(infeasibility, "_MAX_STEPS", 12)  # near enough, in a fifth of the time
    # Normals reach 55 degrees to all sides: at 420 mm that depth is not sharp at f/16 and 2 px.
    problem = face_problem(2, points=30, stand_off=StandOff(400.0, 420.0), coverage=Coverage())
    table = evaluate(problem.subject, problem.cameras, problem.limits).constraints
    units = {row.family: row.unit for row in table}
    found = {c.family: c for c in conflicts(problem, problem.start_values(), NEVER)}
    assert {f: c.unit for f, c in found.items()} == {f: units[f] for f in found}
    # The blur beyond the 0.0115 mm that count as sharp, not the millimetres of depth behind it.
    assert 0.0 < found["depth_of_field"].amount < 0.1


def test_coverage_that_falls_short_is_named_by_its_tier() -> None:
    # Normals reach 55 degrees to all sides, and rays up to 30 count: no two cameras see all.
    problem = face_problem(
        2,
        points=30,
        coverage=Coverage((CoverageTier(2, 1.0),)),
        incidence=Incidence(ray_max_deg=30.0),
        depth_of_field=False,
    )
    found = {c.family: c for c in conflicts(problem, problem.start_values(), NEVER)}
    assert 0.2 < found["coverage_2"].amount <= 1.0


def test_limits_that_hold_have_no_conflicts() -> None:
    problem, result = solved()
    assert conflicts(problem, result.values, NEVER) == ()
