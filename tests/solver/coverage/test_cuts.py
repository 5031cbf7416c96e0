"""Cuts: planes that a camera must rise above, made, kept and dropped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import rigs

from geometry.frames import Pose
from geometry.raycast import Occluder
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from solver.constraints.builders.coverage import assigned_view_constraints, cut_constraints
from solver.coverage.assignment import AssignedViews
from solver.coverage.cuts import VisibilityCuts, cuts_for_hidden, opening_directions
from solver.limits import MotionBox
from solver.problem import Problem, camera_at


def behind_a_wall(elevation_deg: float, motion: MotionBox | None = None) -> Problem:
    """One camera looking over a wall of 100 mm in front of a point that faces up."""
    corners = np.array(
        [[-1e3, -100.0, -1e3], [1e3, -100.0, -1e3], [1e3, -100.0, 100.0], [-1e3, -100.0, 100.0]]
    )
    occluder = Occluder(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    points = SurfacePoints(np.array([[0.0, 0.0, 0.0], [0.0, 200.0, 0.0]]), np.eye(3)[[2, 2]])
    angle = np.radians(elevation_deg)
    eye = 600.0 * np.array([0.0, -np.cos(angle), np.sin(angle)])
    camera = camera_at(
        rigs.compact_camera(), "a", Pose.looking_at(eye, np.zeros(3)), np.zeros((1, 3))
    )
    limits = rigs.face_limits(motion=motion)
    return Problem(Subject(points, points, occluder), (camera,), limits, origin=np.zeros(3))


def state_of(problem: Problem):  # noqa: ANN201
    return problem.unknowns.state(problem.start_values())


ONE_VIEW = AssignedViews(np.array([0]), np.array([0]), np.array([False]))
UP = np.array([[0.0, 0.0, 1.0]])


def test_a_hidden_view_gets_the_plane_over_what_hides_it() -> None:
    problem = behind_a_wall(30.0)
    cuts = cuts_for_hidden(problem, state_of(problem), ONE_VIEW, UP)
    assert cuts.camera.tolist() == [0]
    assert cuts.point.tolist() == [0]
    np.testing.assert_allclose(cuts.plane_point[0], problem.scaled(np.zeros((1, 3)))[0], atol=1e-12)
    # The plane holds the wall's edge, 45 degrees up: see test_visibility for the tolerance.
    half = np.sqrt(0.5)
    np.testing.assert_allclose(cuts.normal[0], [0.0, half, half], atol=1e-3)


def test_a_view_that_is_free_needs_no_cut() -> None:
    problem = behind_a_wall(50.0)
    assert len(cuts_for_hidden(problem, state_of(problem), ONE_VIEW, UP).camera) == 0


def test_each_head_position_has_its_own_cut() -> None:
    problem = behind_a_wall(30.0, MotionBox(z_mm=10.0))
    cuts = cuts_for_hidden(problem, state_of(problem), ONE_VIEW, UP)
    heights = np.unique(np.round(cuts.plane_point[:, 2] * problem.length_mm, 6))
    np.testing.assert_allclose(heights, [-10.0, 0.0, 10.0], atol=1e-9)
    assert (cuts.camera == 0).all()


def test_cuts_turn_with_the_head() -> None:
    problem = behind_a_wall(20.0, MotionBox(pitch_deg=5.0))
    cuts = cuts_for_hidden(problem, state_of(problem), ONE_VIEW, UP)
    angles = np.degrees(np.arctan2(cuts.normal[:, 2], cuts.normal[:, 1]))
    # 45 degrees at rest, and 5 degrees to either side of it.
    np.testing.assert_allclose(np.unique(np.round(angles)), [40.0, 45.0, 50.0])


def test_rows_hold_above_the_plane_by_the_margin_and_break_below() -> None:
    hidden = behind_a_wall(30.0)
    cuts = cuts_for_hidden(hidden, state_of(hidden), ONE_VIEW, UP)
    for elevation, holds in ((44.9, False), (45.2, False), (45.4, True), (80.0, True)):
        above = replace(behind_a_wall(elevation), origin=hidden.origin_mm)
        (rows,) = cut_constraints(above, cuts)
        assert rows.block.family == "coverage"
        assert rows.keep == rows.block.rows
        assert bool(rows.block.violation(state_of(above)).max() == 0.0) is holds


def test_no_cuts_make_no_rows() -> None:
    assert cut_constraints(behind_a_wall(30.0), VisibilityCuts.none()) == []


def some_cuts() -> VisibilityCuts:
    return VisibilityCuts(
        np.array([0, 1, 1]), np.array([5, 5, 7]), np.arange(9.0).reshape(3, 3), np.eye(3)
    )


def test_joined_cuts_keep_all_in_order() -> None:
    joined = some_cuts().joined(some_cuts())
    assert joined.camera.tolist() == [0, 1, 1, 0, 1, 1]
    assert joined.point.tolist() == [5, 5, 7, 5, 5, 7]
    np.testing.assert_array_equal(joined.plane_point[3:], some_cuts().plane_point)
    np.testing.assert_array_equal(joined.normal[:3], np.eye(3))
    assert len(VisibilityCuts.none().joined(VisibilityCuts.none()).camera) == 0


def test_cuts_of_views_that_are_assigned_no_longer_are_dropped() -> None:
    assigned = AssignedViews(np.array([1, 0]), np.array([5, 7]), np.ones(2, bool))
    left = some_cuts().of(assigned)
    assert left.camera.tolist() == [1]
    assert left.point.tolist() == [5]
    np.testing.assert_array_equal(left.plane_point, [[3.0, 4.0, 5.0]])
    np.testing.assert_array_equal(left.normal, [[0.0, 1.0, 0.0]])


def test_rays_of_different_cameras_are_never_mistaken_for_one_another() -> None:
    # camera * stride + point must not collide: (0, 9) and (1, 0) would with a stride of 9.
    cuts = VisibilityCuts(np.array([0]), np.array([9]), np.zeros((1, 3)), np.eye(3)[:1])
    other = AssignedViews(np.array([1]), np.array([0]), np.array([True]))
    assert len(cuts.of(other).camera) == 0
    cuts = VisibilityCuts(np.array([1]), np.array([0]), np.zeros((1, 3)), np.eye(3)[:1])
    other = AssignedViews(np.array([0]), np.array([9]), np.array([True]))
    assert len(cuts.of(other).camera) == 0
    assert len(cuts.of(AssignedViews(*(np.zeros(0, np.int64),) * 2, np.zeros(0, bool))).camera) == 0


def test_the_opening_is_the_ray_where_it_is_free_and_the_normal_where_it_is_not() -> None:
    problem = behind_a_wall(30.0)
    kept = AssignedViews(np.array([0, 0]), np.array([0, 1]), np.array([False, True]))
    found = opening_directions(problem, state_of(problem), kept)
    np.testing.assert_array_equal(found[0], [0.0, 0.0, 1.0])
    eye = problem.cameras[0].pose.position_rig_mm
    np.testing.assert_allclose(found[1], eye - [0.0, 200.0, 0.0], atol=1e-9)


def test_assigned_views_become_cones_of_incidence() -> None:
    problem = behind_a_wall(30.0)
    (rows,) = assigned_view_constraints(problem, ONE_VIEW, 0.0)
    for elevation, holds in ((20.1, True), (19.9, False)):
        at = replace(behind_a_wall(elevation), origin=problem.origin_mm)
        assert bool(rows.block.violation(state_of(at)).max() <= 1e-12) is holds
    (careful,) = assigned_view_constraints(problem, ONE_VIEW, 5.0)
    for elevation, holds in ((25.1, True), (24.9, False)):
        at = replace(behind_a_wall(elevation), origin=problem.origin_mm)
        assert bool(careful.block.violation(state_of(at)).max() <= 1e-12) is holds


def test_assigned_views_hold_in_every_head_position() -> None:
    problem = behind_a_wall(30.0, MotionBox(pitch_deg=5.0))
    (rows,) = assigned_view_constraints(problem, ONE_VIEW, 0.0)
    assert rows.block.rows == len(problem.visibility_positions) == 9
    # 15 + 5 degrees of pitch leave the limit of 70 degrees; 26 - 5 keep it.
    for elevation, holds in ((26.0, True), (24.0, False)):
        at = replace(behind_a_wall(elevation), origin=problem.origin_mm)
        assert bool(rows.block.violation(state_of(at)).max() <= 1e-12) is holds


def test_no_assigned_views_make_no_rows() -> None:
    nothing = AssignedViews(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, bool))
    assert assigned_view_constraints(behind_a_wall(30.0), nothing, 0.0) == []
