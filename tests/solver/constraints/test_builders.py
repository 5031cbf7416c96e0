"""Constraints built from limits: planted violations are seen, and by as much as was planted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import rigs

from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.optics import blur_disk_mm
from solver.constraints.builders.bodies import body_constraints, box_faces
from solver.constraints.builders.positions import (
    delaunay_edges,
    median_weights,
    nearest_neighbours,
    position_constraints,
)
from solver.constraints.builders.rays import frame_normals, ray_constraints
from solver.constraints.candidates import CandidateConstraints
from solver.limits import (
    BaseHeight,
    Box,
    Centring,
    Frame,
    HalfSpace,
    Incidence,
    Limits,
    MotionBox,
    Spacing,
    Sphere,
    StandOff,
    Symmetry,
    Zones,
)
from solver.problem import Problem

OFF = Limits(frame=None, depth_of_field=False, body_clearance_mm=None, sight_line_clearance_mm=None)


def problem_of(limits: Limits, *positions: tuple[float, float, float]) -> Problem:
    """Cameras at positions about the origin, looking at it."""
    subject = rigs.face(30, 60)
    cameras = tuple(
        RigCamera(f"c{k}", rigs.compact_camera(), Pose.looking_at(np.array(p), np.zeros(3)), 900.0)
        for k, p in enumerate(positions)
    )
    return Problem(subject, cameras, limits, origin=np.zeros(3))


def violation(
    problem: Problem, build: Callable[..., list[CandidateConstraints]]
) -> dict[str, float]:
    """The worst violation of each family in the unit that a user knows."""
    state = problem.unknowns.state(problem.start_values())
    found: dict[str, float] = {}
    for rows in build(problem, state):
        worst = float(rows.block.violation(state).max()) * rows.block.natural
        found[rows.block.family] = max(found.get(rows.block.family, 0.0), worst)
    return found


def of_rays(problem: Problem, _: object) -> list[CandidateConstraints]:
    return ray_constraints(problem, np.ones((problem.count, 60), dtype=np.bool_))


A, B, C = (0.0, -800.0, 0.0), (200.0, -800.0, 0.0), (-200.0, -800.0, 300.0)


# --- positions --------------------------------------------------------------------------------


def test_limits_that_are_off_build_nothing() -> None:
    assert violation(problem_of(OFF, A, B), position_constraints) == {}
    assert violation(problem_of(OFF, A, B), body_constraints) == {}


def test_stand_off_is_broken_by_as_much_as_the_camera_is_too_near_or_too_far() -> None:
    limits = replace(OFF, stand_off=StandOff(810.0, 820.0))
    found = violation(problem_of(limits, A, B), position_constraints)
    assert found["stand_off_min"] == pytest.approx(10.0)
    assert found["stand_off_max"] == pytest.approx(np.hypot(200.0, 800.0) - 820.0)


def test_base_height_limits_speak_of_pairs_neighbours_and_the_mean() -> None:
    limits = replace(
        OFF,
        base_height=BaseHeight(min=0.3, max=0.4, neighbour_max=0.35),
    )
    heights = {k: np.linalg.norm(p) for k, p in zip("abc", (A, B, C), strict=True)}

    def ratio(p: tuple[float, ...], q: tuple[float, ...], hp: float, hq: float) -> float:
        return float(2.0 * np.linalg.norm(np.subtract(p, q)) / (hp + hq))

    ab = ratio(A, B, heights["a"], heights["b"])
    ac = ratio(A, C, heights["a"], heights["c"])
    bc = ratio(B, C, heights["b"], heights["c"])
    found = violation(problem_of(limits, A, B, C), position_constraints)
    assert found["base_height_min"] == pytest.approx(0.3 - min(ab, ac, bc))
    assert found["base_height_max"] == pytest.approx(max(ab, ac, bc) - 0.4)
    # C's nearest neighbour is A.
    assert found["base_height_neighbour"] == pytest.approx(ac - 0.35)
    mean = (ab + ac + bc) / 3.0
    for changes, family, by in (
        ({"mean_min": mean + 0.1}, "base_height_mean_min", 0.1),
        ({"mean_max": mean - 0.1}, "base_height_mean_max", 0.1),
    ):
        asked = replace(OFF, base_height=BaseHeight(**changes))
        told = violation(problem_of(asked, A, B, C), position_constraints)
        assert told == {family: pytest.approx(by)}


def test_one_camera_has_no_base() -> None:
    limits = replace(OFF, base_height=BaseHeight(min=0.3), spacing=Spacing(100.0))
    assert violation(problem_of(limits, A), position_constraints) == {}


def test_spacing_is_the_mean_delaunay_edge() -> None:
    # Three cameras are joined all with all.
    limits = replace(OFF, spacing=Spacing(200.0, 5.0))
    edges = [np.linalg.norm(np.subtract(p, q)) for p, q in ((A, B), (A, C), (B, C))]
    found = violation(problem_of(limits, A, B, C), position_constraints)
    assert found["spacing"] == pytest.approx(np.mean(edges) - 205.0)


def test_delaunay_edges_of_a_square_are_its_sides_and_one_diagonal() -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]) + 0.01
    square[2] += [0.05, 0.1, 0.0]
    first, second = delaunay_edges(square)
    assert set(zip(first.tolist(), second.tolist(), strict=True)) == {
        (0, 1), (1, 2), (2, 3), (0, 3), (1, 3),
    }  # fmt: skip


def test_delaunay_edges_of_cameras_in_space_are_those_of_their_cells() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.9, 0.9, 0.9]])
    first, second = delaunay_edges(corners)
    assert len(first) == 9 or len(first) == 10
    assert (first < second).all()


def test_cameras_on_a_line_are_joined_all_with_all() -> None:
    first, _ = delaunay_edges(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]))
    assert len(first) == 6


def test_nearest_neighbours_by_brute_force() -> None:
    centres = np.random.default_rng(3).normal(size=(7, 3))
    every, nearest = nearest_neighbours(centres)
    for k in every:
        away = [np.inf if j == k else np.linalg.norm(centres[k] - centres[j]) for j in range(7)]
        assert nearest[k] == int(np.argmin(away))


@pytest.mark.parametrize("n", [3, 4, 7, 8])
def test_median_weights_give_the_median(n: int) -> None:
    values = np.random.default_rng(n).normal(size=n)
    assert median_weights(values) @ values == pytest.approx(np.median(values))


def test_symmetry_speaks_of_the_mean_and_the_median() -> None:
    limits = replace(OFF, symmetry=Symmetry("x", 0.0, 10.0))
    found = violation(problem_of(limits, A, B, C, (300.0, -800.0, 0.0)), position_constraints)
    x = np.array([0.0, 200.0, -200.0, 300.0])
    assert found["symmetry_median_x"] == pytest.approx(abs(x.mean() - np.median(x)))
    assert found["symmetry_balance_x"] == pytest.approx(abs(x.mean()) - 10.0)
    only = violation(
        problem_of(replace(OFF, symmetry=Symmetry("xz", None, 0.0)), A, B), position_constraints
    )
    assert set(only) == {"symmetry_balance_x", "symmetry_balance_z"}


# --- bodies -----------------------------------------------------------------------------------


def body_of(changes: dict[str, object], *positions: tuple[float, float, float]) -> dict[str, float]:
    return violation(problem_of(replace(OFF, **changes), *positions), body_constraints)


def test_a_box_is_left_by_the_spheres_of_the_body_too() -> None:
    around = Box(np.array([-300.0, -1000.0, -300.0]), np.array([300.0, -700.0, 300.0]))
    assert body_of({"zones": Zones(allowed=(around,))}, A)["zone_allowed"] == 0.0
    tight = Box(np.array([-300.0, -1000.0, -10.0]), np.array([300.0, -700.0, 300.0]))
    broken = body_of({"zones": Zones(allowed=(tight,))}, A)["zone_allowed"]
    # Half the body is 22.5 mm high; the cover reaches at most half a cell's diagonal beyond it.
    assert 12.5 <= broken <= 12.5 + 0.5 * np.linalg.norm([62 / 3, 22.5, 16])


def test_one_allowed_zone_is_enough_and_the_nearest_is_taken() -> None:
    here, there = Sphere(np.array(A), 200.0), Sphere(np.array([5e3, 0.0, 0.0]), 10.0)
    assert body_of({"zones": Zones(allowed=(there, here))}, A)["zone_allowed"] == 0.0
    assert body_of({"zones": Zones(allowed=(there,))}, A)["zone_allowed"] > 4000.0


@pytest.mark.parametrize(
    "zone",
    [
        Sphere(np.array([0.0, -820.0, 0.0]), 50.0),
        Box(np.array([-50.0, -900.0, -50.0]), np.array([50.0, -750.0, 50.0])),
        HalfSpace(np.array([0.0, 0.0, 1.0]), -100.0),
    ],
)
def test_forbidden_zones_are_broken_inside_and_hold_outside(zone: object) -> None:
    zones = Zones(forbidden=(zone,))
    assert body_of({"zones": zones}, A)["zone_forbidden"] > 20.0
    assert body_of({"zones": zones}, (0.0, -800.0, -500.0))["zone_forbidden"] == 0.0


def test_half_spaces_allow_their_own_side() -> None:
    above = Zones(allowed=(HalfSpace(np.array([0.0, 0.0, 1.0]), 100.0),))
    assert body_of({"zones": above}, (0.0, -800.0, 400.0))["zone_allowed"] == 0.0
    # 100 mm and the cover of the body's lower half: 22.5 mm and less than a cell's diagonal.
    assert 122.5 <= body_of({"zones": above}, A)["zone_allowed"] < 140.0


def test_box_faces_point_inwards() -> None:
    normals, offsets = box_faces(Box(np.array([-1.0, -2.0, -3.0]), np.array([1.0, 2.0, 3.0])))
    assert (normals @ np.zeros(3) >= offsets).all()
    for outside in (
        [1.1, 0, 0],
        [-1.1, 0, 0],
        [0, 2.1, 0],
        [0, -2.1, 0],
        [0, 0, 3.1],
        [0, 0, -3.1],
    ):
        assert (normals @ np.array(outside) < offsets).sum() == 1


def test_bodies_that_overlap_collide_and_clearance_is_added() -> None:
    beside = (61.0, -800.0, 0.0)
    assert body_of({"body_clearance_mm": 0.0}, A, beside)["body_clearance"] > 1.0
    # 62 mm of body, and the covers' reach beyond it on both sides.
    assert body_of({"body_clearance_mm": 0.0}, A, (85.0, -800.0, 0.0))["body_clearance"] == 0.0
    near = body_of({"body_clearance_mm": 100.0}, A, (120.0, -800.0, 0.0))["body_clearance"]
    nearer = body_of({"body_clearance_mm": 110.0}, A, (120.0, -800.0, 0.0))["body_clearance"]
    assert nearer - near == pytest.approx(10.0)


def test_a_neighbour_in_front_of_the_lens_is_seen() -> None:
    in_front, behind = (0.0, -500.0, 0.0), (0.0, -1100.0, 0.0)
    assert body_of({"sight_line_clearance_mm": 0.0}, A, in_front)["sight_line"] > 0.0
    assert body_of({"sight_line_clearance_mm": 0.0}, A, (700.0, -800.0, 0.0))["sight_line"] == 0.0
    # Who stands behind is not in that camera's view, but has the first one in its own.
    assert body_of({"sight_line_clearance_mm": 0.0}, A, behind)["sight_line"] > 0.0


def test_fixed_cameras_do_not_collide_with_each_other() -> None:
    problem = problem_of(replace(OFF, body_clearance_mm=0.0), A, (50.0, -800.0, 0.0))
    still = replace(problem, cameras=tuple(replace(c, fixed=True) for c in problem.cameras))
    assert violation(problem, body_constraints)["body_clearance"] > 0.0
    assert violation(still, body_constraints) == {}


# --- rays -------------------------------------------------------------------------------------


def test_frame_normals_are_zero_on_the_sides_and_negative_inside() -> None:
    sides = frame_normals(np.array([-0.2, 0.3, -0.1, 0.15]))
    assert (sides @ np.array([0.0, 0.0, 1.0]) < 0.0).all()
    for k, point in enumerate(([-0.2, 0, 1], [0.3, 0, 1], [0, -0.1, 1], [0, 0.15, 1])):
        assert (sides @ np.array(point))[k] == pytest.approx(0.0, abs=1e-15)
    assert (sides @ np.array([0.31, 0.0, 1.0]) > 0.0).tolist() == [False, True, False, False]


def test_the_frame_rows_agree_with_pixels() -> None:
    limits = replace(OFF, frame=Frame(20.0))
    for distance in (350.0, 420.0, 500.0, 700.0, 1000.0):
        problem = problem_of(limits, (0.0, -distance, 0.0))
        camera, points = problem.cameras[0], problem.subject.check_points.points_mm
        pixels, _ = camera.camera.project(camera.pose, points)
        border = np.minimum(pixels + 0.5, np.array([4000, 2667]) - 0.5 - pixels).min()
        assert (violation(problem, of_rays)["frame"] <= 1e-9) == (border >= 20.0)


def test_focus_rows_agree_with_the_blur_disk() -> None:
    limits = replace(OFF, depth_of_field=True)
    sharp = []
    for distance in (500.0, 850.0, 880.0, 900.0, 960.0, 1100.0):
        problem = problem_of(limits, (0.0, -distance, 0.0))
        camera, points = problem.cameras[0], problem.subject.check_points.points_mm
        depth = camera.pose.to_camera(points)[:, 2]
        blur = blur_disk_mm(depth, 900.0, 50.0, 16.0).max()
        sharp.append(bool(blur <= camera.camera.circle_of_confusion_mm))
        assert (violation(problem, of_rays)["depth_of_field"] <= 0.0) == sharp[-1]
    assert True in sharp
    assert False in sharp


def test_sampling_distance_and_minimum_focus_speak_of_the_deepest_and_nearest_point() -> None:
    limits = replace(OFF, gsd_max_mm=0.03)
    problem = problem_of(limits, (0.0, -420.0, 0.0))
    depth = problem.cameras[0].pose.to_camera(problem.subject.check_points.points_mm)[:, 2]
    found = violation(problem, of_rays)
    assert found["gsd"] == pytest.approx(depth.max() / (50.0 / (23.1 / 4000)) - 0.03)
    assert found["min_focus"] == pytest.approx(350.0 - depth.min())


def test_the_head_in_its_box_asks_for_more_frame() -> None:
    still = problem_of(replace(OFF, frame=Frame(20.0)), (0.0, -500.0, 0.0))
    moving = replace(still, limits=replace(still.limits, motion=MotionBox(z_mm=20.0)))
    more = violation(moving, of_rays)["frame"] - violation(still, of_rays)["frame"]
    # A row is f z-distance in units of the length scale: 20 mm of 500 mm, in pixels of f.
    assert more == pytest.approx(20.0 / 500.0 * 50.0 / (23.1 / 4000), rel=1e-6)


def test_centring_is_the_mean_image_coordinate() -> None:
    problem = problem_of(replace(OFF, centring=Centring(3.0)), (150.0, -900.0, 50.0))
    local = problem.cameras[0].pose.to_camera(problem.subject.design_points.points_mm)
    mean = np.abs((local[:, :2] / local[:, 2:]).mean(axis=0)).max() * 50.0 / (23.1 / 4000)
    assert violation(problem, of_rays)["centring"] == pytest.approx(mean - 3.0)


def test_points_that_were_added_do_not_move_the_mean() -> None:
    problem = problem_of(
        replace(OFF, centring=Centring(), incidence=Incidence(60.0, 10.0)), (150.0, -900.0, 50.0)
    )
    first = replace(problem, object_points=10)
    subject = replace(
        problem.subject, design_points=problem.subject.design_points.subset(np.arange(10))
    )
    alone = violation(replace(problem, subject=subject), of_rays)
    assert violation(first, of_rays) == pytest.approx(alone)
    assert violation(problem, of_rays)["centring"] != pytest.approx(alone["centring"])


def test_fixed_cameras_have_no_rows_about_rays() -> None:
    problem = problem_of(replace(OFF, frame=Frame(), centring=Centring()), A, B)
    cameras = (replace(problem.cameras[0], fixed=True), problem.cameras[1])
    rows = of_rays(replace(problem, cameras=cameras), None)
    assert rows
    for row in rows:
        assert set(row.block.camera.tolist()) == {1}
