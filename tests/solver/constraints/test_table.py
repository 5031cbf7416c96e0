"""The constraint table: planted breaches appear by name, by as much as was planted."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import rigs
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.optics import blur_disk_mm
from solver.constraints.table import BINDING, SATISFIED, constraint_table, row
from solver.limits import (
    BaseHeight,
    Box,
    Centring,
    Coverage,
    CoverageTier,
    Frame,
    HalfSpace,
    Incidence,
    Limits,
    MotionBox,
    PoseBounds,
    Spacing,
    StandOff,
    Symmetry,
    Zones,
)
from solver.problem import Problem
from solver.result import ConstraintRow, CoverageShare, Sense

OFF = Limits(frame=None, depth_of_field=False, body_clearance_mm=None, sight_line_clearance_mm=None)
A, B, C = (0.0, -800.0, 0.0), (200.0, -800.0, 0.0), (-200.0, -800.0, 300.0)
CHECK = 60
SUBJECT = rigs.face(30, CHECK)


@cache
def kind(**changes: object):  # noqa: ANN201
    return rigs.compact_camera(**changes)


def problem_of(
    limits: Limits, *positions: tuple[float, float, float], focus_mm: float = 900.0
) -> Problem:
    """Cameras at positions about the origin, looking at it."""
    cameras = tuple(
        RigCamera(f"c{k}", kind(), Pose.looking_at(np.array(p), np.zeros(3)), focus_mm)
        for k, p in enumerate(positions)
    )
    return Problem(SUBJECT, cameras, limits, origin=np.zeros(3))


def table(problem: Problem, seen: np.ndarray | None = None, coverage=()):  # noqa: ANN001, ANN201
    """The rows by name; all cameras see all points unless told otherwise."""
    visible = np.ones((problem.count, CHECK), dtype=np.bool_) if seen is None else seen
    rows = constraint_table(problem, [visible], coverage)
    assert len({r.name for r in rows}) == len(rows)
    return {r.name: r for r in rows}


# --- one row ----------------------------------------------------------------------------------

numbers = st.floats(-1e4, 1e4).map(lambda x: round(x, 6))


@settings(max_examples=100, deadline=None, derandomize=True)
@given(numbers, numbers, st.sampled_from(list(Sense)), st.floats(0.1, 1e4), st.floats(0.0, 100.0))
def test_slack_is_what_may_still_be_given(
    value: float, limit: float, sense: Sense, scale: float, tolerance: float
) -> None:
    found = row("a/b", value, limit, sense, "mm", scale, tolerance)
    away = value - limit
    expected = {
        Sense.AT_MOST: -away,
        Sense.AT_LEAST: away,
        Sense.EQUAL: tolerance - abs(away),
    }[sense]
    assert found.slack == pytest.approx(expected)
    assert found.satisfied == (found.slack >= -SATISFIED * scale)
    assert found.active == (found.slack < BINDING * scale)
    # What is broken always binds.
    assert found.active or found.satisfied


def test_a_row_is_named_by_its_family_and_subject() -> None:
    found = row("base_height_min/c0-c1", 0.2, 0.15, Sense.AT_LEAST, "", 1.0)
    assert (found.family, found.subject) == ("base_height_min", "c0-c1")


def test_an_equality_binds_only_at_an_end_of_its_tolerance() -> None:
    def centred(px: float) -> ConstraintRow:
        return row("centring_x/c0", px, 0.0, Sense.EQUAL, "px", 4000.0, 100.0)

    assert not centred(0.0).active
    assert not centred(-90.0).active
    assert centred(-100.0).active
    assert centred(99.0).active
    assert centred(-100.0).satisfied
    assert not centred(100.1).satisfied
    # Without any tolerance it binds by its nature.
    assert row("a/b", 0.0, 0.0, Sense.EQUAL, "mm", 1.0).active


def test_a_scale_of_nothing_does_not_excuse_a_breach() -> None:
    assert not row("gsd/c0", 1e-9, 0.0, Sense.AT_MOST, "mm", 0.0).satisfied


# --- frame, focus, sampling -------------------------------------------------------------------


def test_limits_that_are_off_have_no_rows() -> None:
    # Without depth of field a camera still has to be able to focus on what it sees.
    assert set(table(problem_of(OFF, A, B))) == {"min_focus/c0", "min_focus/c1"}


def test_the_frame_is_judged_in_pixels_at_the_worst_point() -> None:
    problem = problem_of(replace(OFF, frame=Frame(20.0)), (0.0, -420.0, 0.0))
    pixels, _ = kind().project(problem.cameras[0].pose, SUBJECT.check_points.points_mm)
    worst = np.minimum(pixels + 0.5, np.array([3999.5, 2666.5]) - pixels).min()
    found = table(problem)["frame/c0"]
    assert found.value == pytest.approx(worst)
    assert found.slack == pytest.approx(worst - 20.0)
    assert found.satisfied == (worst >= 20.0)


def test_only_what_a_camera_sees_has_to_be_in_its_frame() -> None:
    limits = replace(OFF, frame=Frame(20.0), depth_of_field=True)
    problem = problem_of(limits, (0.0, -330.0, 0.0), focus_mm=360.0)
    pixels, _ = kind().project(problem.cameras[0].pose, SUBJECT.check_points.points_mm)
    border = np.minimum(pixels + 0.5, np.array([3999.5, 2666.5]) - pixels).min(axis=1)
    assert not table(problem)["frame/c0"].satisfied
    assert table(problem, (border > 25.0)[None])["frame/c0"].satisfied
    # One who sees nothing is asked for a focus that the lens has, and for nothing else.
    assert set(table(problem, np.zeros((1, CHECK), bool))) == {"min_focus/c0"}


def test_the_blur_is_that_of_the_nearest_or_farthest_point() -> None:
    for focus in (700.0, 760.0, 900.0):
        problem = problem_of(replace(OFF, depth_of_field=True), A, focus_mm=focus)
        depth = problem.cameras[0].pose.to_camera(SUBJECT.check_points.points_mm)[:, 2]
        ends = np.array([depth.min(), depth.max()])
        blur = blur_disk_mm(ends, focus, 50.0, 16.0).max()
        assert table(problem)["depth_of_field/c0"].value == pytest.approx(blur)


def test_a_point_behind_the_camera_is_neither_in_frame_nor_sharp() -> None:
    away = RigCamera("c0", kind(), Pose.looking_at(np.array(A), np.array([0.0, -2000.0, 0.0])), 900)
    limits = replace(OFF, frame=Frame(), depth_of_field=True)
    found = table(Problem(SUBJECT, (away,), limits, origin=np.zeros(3)))
    assert found["frame/c0"].value == -np.inf
    assert found["depth_of_field/c0"].value == np.inf
    assert not found["frame/c0"].satisfied
    assert not found["depth_of_field/c0"].satisfied


def test_a_focus_nearer_than_the_lens_allows_is_told() -> None:
    problem = problem_of(replace(OFF, depth_of_field=True), A, focus_mm=340.0)
    found = table(problem)["min_focus/c0"]
    assert (found.value, found.limit, found.satisfied) == (340.0, 350.0, False)
    near = problem_of(OFF, (0.0, -430.0, 0.0))
    depth = near.cameras[0].pose.to_camera(SUBJECT.check_points.points_mm)[:, 2]
    assert table(near)["min_focus/c0"].slack == pytest.approx(depth.min() - 350.0)


def test_the_sampling_distance_is_that_of_the_farthest_point() -> None:
    problem = problem_of(replace(OFF, gsd_max_mm=0.1), A)
    depth = problem.cameras[0].pose.to_camera(SUBJECT.check_points.points_mm)[:, 2]
    assert table(problem)["gsd/c0"].value == pytest.approx(depth.max() * (23.1 / 4000) / 50.0)


def test_the_head_moved_asks_for_more_frame() -> None:
    still = problem_of(replace(OFF, frame=Frame()), A)
    moving = replace(still, limits=replace(still.limits, motion=MotionBox(z_mm=20.0)))
    lost = table(still)["frame/c0"].value - table(moving)["frame/c0"].value
    # 20 mm across the view at a depth of 690 to 800 mm, 8658 pixels of focal length.
    assert 20.0 / 800.0 * 8658.0 - 1e-6 <= lost <= 20.0 / 690.0 * 8658.0


# --- means ------------------------------------------------------------------------------------


def test_centring_tells_the_mean_pixel_of_each_axis() -> None:
    problem = problem_of(replace(OFF, centring=Centring(3.0)), (150.0, -900.0, 50.0))
    camera = problem.cameras[0]
    local = camera.pose.to_camera(SUBJECT.design_points.points_mm)
    mean = (local[:, :2] / local[:, 2:]).mean(axis=0) * 50.0 / (23.1 / 4000)
    found = table(problem)
    for axis, expected in zip("xy", mean, strict=True):
        told = found[f"centring_{axis}/c0"]
        assert told.value == pytest.approx(expected)
        assert told.sense is Sense.EQUAL
        assert told.slack == pytest.approx(3.0 - abs(expected))


def test_mean_incidence_is_between_axis_and_normals() -> None:
    limits = replace(OFF, incidence=Incidence(75.0, 20.0))
    found = table(problem_of(limits, A, C))
    for name, position in (("c0", A), ("c1", C)):
        back = np.array(position) / np.linalg.norm(position)
        angles = [np.degrees(np.arccos(n @ back)) for n in SUBJECT.design_points.normals]
        assert found[f"incidence_mean/{name}"].value == pytest.approx(np.mean(angles))


# --- places and bodies ------------------------------------------------------------------------


def test_each_pair_and_each_camera_has_its_own_row_of_places() -> None:
    limits = replace(OFF, base_height=BaseHeight(min=0.3), stand_off=StandOff(810.0, None))
    found = table(problem_of(limits, A, B, C))
    pairs = {n for n in found if n.startswith("base_height_min")}
    assert pairs == {f"base_height_min/{p}" for p in ("c0-c1", "c0-c2", "c1-c2")}
    ratio = 2.0 * 200.0 / (800.0 + np.hypot(200.0, 800.0))
    assert found["base_height_min/c0-c1"].value == pytest.approx(ratio)
    assert found["stand_off_min/c0"].slack == pytest.approx(-10.0)
    assert found["stand_off_min/c1"].slack == pytest.approx(np.hypot(200.0, 800.0) - 810.0)


def test_limits_about_all_cameras_are_rows_about_all() -> None:
    edges = [np.linalg.norm(np.subtract(p, q)) for p, q in ((A, B), (A, C), (B, C))]
    limits = replace(
        OFF,
        spacing=Spacing(float(np.mean(edges)) - 4.0, 5.0),
        symmetry=Symmetry("x", 2.0, None),
        base_height=BaseHeight(mean_min=0.1),
    )
    found = table(problem_of(limits, A, B, C))
    spacing = found["spacing/all"]
    assert spacing.slack == pytest.approx(1.0)
    assert spacing.limit == pytest.approx(np.mean(edges) - 4.0)
    assert found["symmetry_median_x/all"].value == pytest.approx(0.0, abs=1e-9)
    assert found["base_height_mean_min/all"].satisfied


@pytest.mark.parametrize("asked_mm", [0.0, 30.0])
def test_clearance_between_bodies_is_told_as_it_is(asked_mm: float) -> None:
    limits = replace(OFF, body_clearance_mm=asked_mm)
    apart, closer = (
        table(problem_of(limits, A, (gap, -800.0, 0.0)))["body_clearance/c0-c1"]
        for gap in (150.0, 140.0)
    )
    assert apart.limit == pytest.approx(asked_mm)
    # Bodies 62 mm wide whose covers reach up to half a cell's diagonal (20 mm) beyond them.
    assert 150.0 - 62.0 - 40.0 <= apart.value <= 150.0 - 62.0
    # They are turned towards the head by atan(150 / 800), so not quite 10 mm nearer.
    assert apart.value - closer.value == pytest.approx(10.0, rel=0.05)


def test_zones_tell_the_worst_sphere_of_a_body_as_a_clearance() -> None:
    box = Box(np.array([-300.0, -1000.0, -10.0]), np.array([300.0, -700.0, 300.0]))
    found = table(problem_of(replace(OFF, zones=Zones(allowed=(box,))), A))["zone_allowed/c0"]
    # Half a body of 45 mm stands out below the floor at -10 mm, its cover up to 20 mm more.
    assert -12.5 - 20.0 <= found.slack <= -12.5
    plane = HalfSpace(np.array([0.0, 0.0, 1.0]), 100.0)
    clear = table(problem_of(replace(OFF, zones=Zones(forbidden=(plane,))), A))["zone_forbidden/c0"]
    assert 100.0 - 22.5 - 20.0 <= clear.slack <= 100.0 - 22.5


# --- coverage and bounds ----------------------------------------------------------------------


def test_coverage_of_more_views_than_cameras_is_that_of_all_cameras() -> None:
    tiers = (CoverageTier(2, 0.9), CoverageTier(3, 0.5))
    problem = problem_of(replace(OFF, coverage=Coverage(tiers)), A, B)
    reached = (CoverageShare(1, 1.0), CoverageShare(2, 0.8))
    found = table(problem, coverage=reached)
    assert found["coverage_2/all"].slack == pytest.approx(-0.1)
    assert found["coverage_3/all"].value == 0.8
    assert table(problem)["coverage_2/all"].value == 0.0


def test_bounds_are_about_the_anchor_and_angles_go_round() -> None:
    anchor = Pose.from_omega_phi_kappa(np.array(A), np.array([90.0, 0.0, 179.0]))
    now = Pose.from_omega_phi_kappa(np.add(A, [30.0, 0.0, -7.0]), np.array([85.0, 0.0, -178.0]))
    limits = replace(OFF, bounds=PoseBounds(omega_deg=4.0, kappa_deg=5.0, x_mm=40.0, z_mm=5.0))
    problem = Problem(
        SUBJECT, (RigCamera("c0", kind(), now, 900.0),), limits, (anchor,), np.zeros(3)
    )
    found = {n: r for n, r in table(problem).items() if n.startswith("bound_")}
    assert {n: r.value for n, r in found.items()} == {
        "bound_omega/c0": pytest.approx(5.0),
        "bound_kappa/c0": pytest.approx(3.0),
        "bound_x/c0": pytest.approx(30.0),
        "bound_z/c0": pytest.approx(7.0),
    }
    assert {n for n, r in found.items() if not r.satisfied} == {"bound_omega/c0", "bound_z/c0"}
    # Without an anchor nobody can say how far a camera moved.
    assert not [n for n in table(replace(problem, anchor=None)) if n.startswith("bound_")]
