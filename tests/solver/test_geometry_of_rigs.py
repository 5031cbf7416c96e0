"""Variables, head positions, sphere covers and starts: the geometry under the constraints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rigs
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from geometry.camera import Body
from geometry.frames import Pose
from geometry.optics import blur_disk_mm
from geometry.surface import HULLS_KEPT, SurfacePoints
from solver.limits import Frame, MotionBox, PoseBounds, StandOff
from solver.motion import HeadPosition, framing_positions, rest, visibility_positions
from solver.problem import Problem, camera_at
from solver.sphere_cover import sphere_cover
from solver.starts import axis_rotation, better_roll, fitting_distance, kmeans_start, strip, strips
from solver.variables import FOCUS, PER_CAMERA, Unknowns

PIVOT = np.array([10.0, -20.0, 30.0])


# --- variables --------------------------------------------------------------------------------


def random_poses(seed: int, count: int) -> tuple[Pose, ...]:
    rng = np.random.default_rng(seed)
    rotations = Rotation.random(count, rng=rng).as_matrix()
    return tuple(Pose(900.0 * rng.normal(size=3), r) for r in rotations)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 10_000))
def test_poses_survive_packing_and_unpacking(seed: int) -> None:
    poses = random_poses(seed, 3)
    base = Rotation.random(3, rng=np.random.default_rng(seed + 1)).as_matrix()
    unknowns = Unknowns(base, PIVOT, 850.0, np.arange(21))
    focus = np.array([500.0, 800.0, 1200.0])
    back, focus_back = unknowns.unpack(unknowns.pack(poses, focus))
    for before, after in zip(poses, back, strict=True):
        # Angles lose half the digits where phi nears 90 degrees: 1e-8 there.
        np.testing.assert_allclose(
            after.rotation_rig_to_camera, before.rotation_rig_to_camera, atol=1e-7
        )
        np.testing.assert_allclose(after.position_rig_mm, before.position_rig_mm, atol=1e-9)
    np.testing.assert_allclose(focus_back, focus)


def test_angles_are_zero_at_the_base_and_those_of_the_paper_on_the_identity() -> None:
    pose = Pose.from_omega_phi_kappa(np.array([1.0, 2.0, 3.0]), np.array([80.0, -21.0, 5.0]))
    problem = Problem(rigs.wall(), rigs.wall_cameras(rigs.WALL_START), rigs.wall_limits())
    values = problem.unknowns.pack((pose,) * 4, np.full(4, 900.0)).reshape(4, PER_CAMERA)
    np.testing.assert_allclose(np.degrees(values[0, :3]), [80.0, -21.0, 5.0], atol=1e-9)
    free = replace(problem, limits=rigs.wall_limits(bounds=PoseBounds(x_mm=1.0)))
    np.testing.assert_allclose(free.start_values().reshape(4, PER_CAMERA)[:, :3], 0.0, atol=1e-12)


def test_rotation_derivatives_match_central_differences() -> None:
    base = Rotation.random(2, rng=np.random.default_rng(0)).as_matrix()
    unknowns = Unknowns(base, np.zeros(3), 1.0, np.arange(14))
    values = np.random.default_rng(1).normal(scale=0.4, size=14)
    state, step = unknowns.state(values), 1e-5
    for a in range(3):
        move = np.zeros(14)
        move[[a, 7 + a]] = step
        up, down = unknowns.state(values + move), unknowns.state(values - move)
        # Error step**2 / 6 and rounding 1e-16 / step.
        first = (up.rotation - down.rotation) / (2 * step)
        np.testing.assert_allclose(state.rotation_1[:, a], first, atol=1e-9)
        second = (up.rotation_1 - down.rotation_1) / (2 * step)
        np.testing.assert_allclose(state.rotation_2[:, a], second, atol=1e-9)


def test_what_is_fixed_or_has_no_say_is_not_free() -> None:
    subject = rigs.face(30, 60)
    cameras = rigs.face_cameras(subject, 3)
    focused = replace(cameras[1], camera=rigs.compact_camera(focus_distance_mm=900.0))
    problem = Problem(
        subject, (replace(cameras[0], fixed=True), focused, cameras[2]), rigs.face_limits()
    )
    assert problem.unknowns.free.tolist() == [*range(7, 13), *range(14, 21)]
    blurred = replace(problem, limits=rigs.face_limits(depth_of_field=False))
    assert 14 + FOCUS not in blurred.unknowns.free


# --- head positions ---------------------------------------------------------------------------


def test_a_head_position_moves_points_rigidly_about_its_pivot() -> None:
    turn = Rotation.from_euler("z", 90.0, degrees=True).as_matrix()
    position = HeadPosition(turn, np.array([1.0, 2.0, 3.0]), PIVOT)
    np.testing.assert_allclose(position.points(PIVOT[None])[0], [11.0, -18.0, 33.0])
    np.testing.assert_allclose(
        position.points(np.array([[15.0, -20.0, 30.0]]))[0], [11.0, -13.0, 33.0]
    )
    np.testing.assert_allclose(position.directions(np.eye(3)[:1])[0], [0.0, 1.0, 0.0], atol=1e-15)


def test_what_the_head_sees_is_the_inverse_of_how_it_moves() -> None:
    rng = np.random.default_rng(5)
    position = HeadPosition(Rotation.random(rng=rng).as_matrix(), rng.normal(size=3), PIVOT)
    points = rng.normal(scale=100.0, size=(6, 3))
    np.testing.assert_allclose(
        position.eye_seen_by_head(position.points(points)), points, atol=1e-11
    )
    one = position.eye_seen_by_head(position.points(points[:1])[0])
    np.testing.assert_allclose(one, points[0], atol=1e-11)


def test_without_a_box_the_head_rests() -> None:
    for positions in (visibility_positions(None, PIVOT), framing_positions(None, PIVOT)):
        assert len(positions) == 1
        np.testing.assert_array_equal(positions[0].points(np.eye(3)), rest(PIVOT).points(np.eye(3)))
        np.testing.assert_allclose(positions[0].points(np.eye(3)), np.eye(3), atol=1e-14)


def test_visibility_is_cast_at_rest_and_in_corners_that_pair_all_signs() -> None:
    positions = visibility_positions(MotionBox(1.0, 2.0, 3.0, 4.0, 5.0, 6.0), PIVOT)
    assert len(positions) == 9
    np.testing.assert_array_equal(positions[0].translation_mm, np.zeros(3))
    found = [
        np.r_[
            p.translation_mm / [1.0, 2.0, 3.0],
            Rotation.from_matrix(p.rotation).as_euler("xyz", degrees=True) / [4.0, 5.0, 6.0],
        ]
        for p in positions[1:]
    ]
    signs = np.round(np.stack(found), 9)
    assert set(np.abs(signs).ravel()) == {1.0}
    for i in range(6):
        for j in range(i):
            assert len({tuple(row) for row in signs[:, [i, j]]}) == 4


def test_framing_is_held_in_every_corner() -> None:
    assert len(framing_positions(MotionBox(x_mm=1.0), PIVOT)) == 2
    assert len(framing_positions(MotionBox(1.0, 1.0, 1.0), PIVOT)) == 8
    assert len(framing_positions(MotionBox(yaw_deg=3.0), PIVOT)) == 3
    assert len(framing_positions(MotionBox(x_mm=1.0, pitch_deg=1.0, yaw_deg=1.0), PIVOT)) == 18


# --- sphere covers ----------------------------------------------------------------------------


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 10_000))
def test_a_cover_contains_the_body_and_reaches_little_beyond(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size, lens = rng.uniform(5.0, 150.0, 3), rng.uniform([5.0, 1.0], [80.0, 120.0])
    body = Body(size, rng.normal(scale=20.0, size=3), *lens)
    centres, radii = sphere_cover(body)
    inside = body.centre_camera_mm + size * rng.uniform(-0.5, 0.5, (400, 3))
    angle, radius = rng.uniform(0.0, 2.0 * np.pi, 400), 0.5 * lens[0] * np.sqrt(rng.random(400))
    depth = body.front_z_mm + lens[1] * rng.random(400)
    lens_points = np.stack([radius * np.cos(angle), radius * np.sin(angle), depth], axis=1)
    points = np.concatenate([inside, lens_points])
    gap = np.linalg.norm(points[:, None] - centres[None], axis=2) - radii[None]
    assert gap.min(axis=1).max() <= 1e-9
    boxes = radii[: np.prod(np.maximum(1, np.ceil(size / 30.0).astype(int)))]
    assert boxes.max() <= 0.5 * np.sqrt(3.0) * 30.0 + 1e-9


def test_a_body_without_a_lens_has_spheres_for_its_box_only() -> None:
    centres, radii = sphere_cover(Body([60.0, 30.0, 30.0], [0.0, 0.0, -15.0]))
    np.testing.assert_allclose(centres, [[-15.0, 0.0, -15.0], [15.0, 0.0, -15.0]])
    np.testing.assert_allclose(radii, np.full(2, np.sqrt(3.0) * 15.0))


# --- starts -----------------------------------------------------------------------------------


def border_px(camera, points: np.ndarray) -> float:  # noqa: ANN001
    pixels, _ = camera.camera.project(camera.pose, points)
    size = np.array(camera.camera.image_size_px)
    return float(np.minimum(pixels + 0.5, size - 0.5 - pixels).min())


def largest_blur_mm(camera, points: np.ndarray) -> float:  # noqa: ANN001
    depth = camera.pose.to_camera(points)[:, 2]
    return float(blur_disk_mm(depth, camera.focus_distance_mm, 50.0, camera.camera.f_number).max())


@pytest.mark.parametrize("f_number", [4.0, 16.0, 32.0])
@pytest.mark.parametrize("roll", [0.0, 90.0])
def test_the_fitting_distance_is_the_smallest_that_fits(f_number: float, roll: float) -> None:
    camera = rigs.compact_camera(f_number=f_number)
    limits = rigs.face_limits(frame=Frame(20.0), stand_off=StandOff())
    points = rigs.face(100, 10).design_points.points_mm
    forward = np.array([0.3, 0.9, -0.2]) / np.linalg.norm([0.3, 0.9, -0.2])
    distance = fitting_distance(camera, limits, points, forward, roll)

    def fits(at: float) -> bool:
        middle = points.mean(axis=0)
        pose = Pose.looking_at(middle - at * forward, middle, roll)
        placed = camera_at(camera, "a", pose, points)
        sharp = largest_blur_mm(placed, points) <= camera.circle_of_confusion_mm * (1.0 + 1e-6)
        return border_px(placed, points) >= 20.0 - 1e-6 and sharp

    assert fits(distance)
    assert not fits(0.999 * distance)


def test_the_fitting_distance_stays_within_the_stand_off() -> None:
    points = rigs.face(100, 10).design_points.points_mm
    # Wide open it is the depth of field that asks for distance, not the frame.
    camera, forward = rigs.compact_camera(f_number=4.0), np.array([0.0, 1.0, 0.0])
    free = fitting_distance(camera, rigs.face_limits(stand_off=StandOff()), points, forward, 0.0)
    far = rigs.face_limits(stand_off=StandOff(min_mm=2.0 * free))
    near = rigs.face_limits(stand_off=StandOff(max_mm=0.9 * free))
    assert fitting_distance(camera, far, points, forward, 0.0) == pytest.approx(2.0 * free)
    assert fitting_distance(camera, near, points, forward, 0.0) <= 0.9 * free + 1e-9


def test_portrait_is_chosen_where_it_lets_the_camera_stand_closer() -> None:
    points = rigs.face(100, 10).design_points.points_mm
    limits = rigs.face_limits(depth_of_field=False, stand_off=StandOff())
    forward = np.array([0.0, 1.0, 0.0])
    tall, wide = points * [0.5, 1.0, 1.0], points * [1.0, 1.0, 0.5]
    assert better_roll(rigs.compact_camera(), limits, tall, forward)[0] == 90.0
    assert better_roll(rigs.compact_camera(), limits, wide, forward)[0] == 0.0


def test_the_axis_rotation_looks_along_its_direction_and_is_level() -> None:
    for forward in np.random.default_rng(3).normal(size=(10, 3)):
        rotation = axis_rotation(forward / np.linalg.norm(forward))
        np.testing.assert_allclose(rotation[2], forward / np.linalg.norm(forward), atol=1e-12)
        assert rotation[0, 2] == pytest.approx(0.0, abs=1e-12)


def test_the_kmeans_start_stands_on_the_normals_of_its_clusters() -> None:
    subject, limits = rigs.face(200, 60), rigs.face_limits()
    cameras = kmeans_start(subject, rigs.compact_camera(), limits, rigs.names(4), 0)
    points = subject.design_points
    assert [c.name for c in cameras] == list(rigs.names(4))
    for camera in cameras:
        axis = camera.pose.rotation_rig_to_camera[2]
        # What a camera looks along is the mean normal of the points about where it looks.
        to_point = points.points_mm - camera.pose.position_rig_mm
        off_axis = np.linalg.norm(to_point - np.outer(to_point @ axis, axis), axis=1)
        near = points.normals[np.argsort(off_axis)[:20]].mean(axis=0)
        assert near @ -axis / np.linalg.norm(near) > np.cos(np.radians(15.0))
        assert border_px(camera, points.points_mm) >= 19.9


def test_the_same_seed_gives_the_same_start_and_jitter_moves_it() -> None:
    subject, limits = rigs.face(100, 60), rigs.face_limits()

    def poses(seed: int, jitter: float) -> np.ndarray:
        start = kmeans_start(subject, rigs.compact_camera(), limits, rigs.names(3), seed, jitter)
        return np.stack([c.pose.position_rig_mm for c in start])

    np.testing.assert_array_equal(poses(1, 1.0), poses(1, 1.0))
    moved = np.linalg.norm(poses(1, 1.0) - poses(1, 0.0), axis=1)
    assert (moved > 1.0).all()
    assert (moved < 700.0).all()


def test_as_many_cameras_as_points_still_start() -> None:
    few = rigs.ellipsoid_points(3, 1)
    subject = replace(rigs.face(10, 20), design_points=few)
    cameras = kmeans_start(subject, rigs.compact_camera(), rigs.face_limits(), rigs.names(3), 0)
    assert len(cameras) == 3


def test_a_strip_is_level_equally_spaced_and_of_its_span() -> None:
    subject, limits = rigs.face(100, 60), rigs.face_limits()
    cameras = strip(subject, rigs.compact_camera(), limits, rigs.names(4), 60.0)
    middle = subject.design_points.centroid_mm
    away = np.stack([c.pose.position_rig_mm for c in cameras]) - middle
    np.testing.assert_allclose(away[:, 2], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), np.linalg.norm(away[0]))
    turn = np.degrees(np.arctan2(away[:, 0], -away[:, 1]))
    np.testing.assert_allclose(np.diff(turn), 20.0, atol=1e-9)
    for camera in cameras:
        assert border_px(camera, subject.check_points.points_mm) >= 20.0 - 1e-6


def test_strips_of_several_spans_are_offered() -> None:
    subject = rigs.face(60, 60)
    offered = strips(subject, rigs.compact_camera(), rigs.face_limits(), rigs.names(3))
    spans = []
    for cameras in offered:
        ends = [c.pose.position_rig_mm - subject.design_points.centroid_mm for c in cameras]
        cosine = ends[0] @ ends[-1] / np.linalg.norm(ends[0]) / np.linalg.norm(ends[-1])
        spans.append(np.degrees(np.arccos(cosine)))
    np.testing.assert_allclose(spans, [10, 20, 30, 40, 50, 60, 75, 90, 105, 120, 140], atol=1e-6)


# --- problems ---------------------------------------------------------------------------------


def test_a_camera_is_focused_where_near_and_far_are_equally_sharp() -> None:
    points = rigs.face(100, 60).design_points.points_mm
    pose = Pose.looking_at(np.array([0.0, -900.0, 0.0]), points.mean(axis=0))
    camera = camera_at(rigs.compact_camera(), "a", pose, points)
    depth = pose.to_camera(points)[:, 2]
    blur = blur_disk_mm(np.array([depth.min(), depth.max()]), camera.focus_distance_mm, 50.0, 16.0)
    assert blur[0] == pytest.approx(blur[1], rel=1e-9)
    set_focus = camera_at(rigs.compact_camera(focus_distance_mm=700.0), "a", pose, points)
    assert set_focus.focus_distance_mm == 700.0


def test_the_hull_stands_for_all_points() -> None:
    inside = np.random.default_rng(1).normal(size=(300, 3))
    subject = replace(rigs.face(30, 300), check_points=SurfacePoints(inside, inside))
    problem = Problem(subject, rigs.face_cameras(subject, 1), rigs.face_limits())
    hull = problem.hull(np.ones(300, bool))
    assert len(hull) < 100
    for direction in np.random.default_rng(0).normal(size=(20, 3)):
        assert (hull @ direction).max() == (inside @ direction).max()
    assert len(problem.hull(np.arange(300) < 5)) == 5


def test_a_hull_is_found_once_for_each_set_of_points(monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[int] = []

    def counted(points: np.ndarray) -> ConvexHull:
        found.append(len(points))
        return ConvexHull(points)

    monkeypatch.setattr("geometry.surface.ConvexHull", counted)
    rng = np.random.default_rng(2)
    inside = rng.normal(size=(60, 3))
    points = SurfacePoints(inside, inside)
    masks = rng.random((HULLS_KEPT + 20, 60)) < 0.7
    for mask in masks:
        first = points.corners_mm(mask)
        assert points.corners_mm(mask.copy()) is first
        assert np.array_equal(first, inside[mask][ConvexHull(inside[mask]).vertices])
    assert found == masks.sum(axis=1).tolist()


def test_the_problem_scales_lengths_about_its_origin() -> None:
    subject = rigs.face(30, 60)
    problem = Problem(subject, rigs.face_cameras(subject, 3), rigs.face_limits())
    away = [np.linalg.norm(c.pose.position_rig_mm - problem.origin_mm) for c in problem.cameras]
    assert problem.length_mm == pytest.approx(np.mean(away))
    np.testing.assert_allclose(problem.points.mean(axis=0), 0.0, atol=1e-15)
    # An unseen point has a standard deviation of 1 mm, so 1 / length**2 scaled.
    assert problem.prior == pytest.approx(problem.length_mm**2)
    np.testing.assert_allclose(problem.ray_weight, (50.0 / (23.1 / 4000) / 0.5) ** 2)


def test_placing_keeps_fixed_cameras_as_they_are() -> None:
    subject = rigs.face(30, 60)
    cameras = rigs.face_cameras(subject, 2)
    problem = Problem(subject, (replace(cameras[0], fixed=True), cameras[1]), rigs.face_limits())
    placed = problem.placed(problem.start_values() + 0.01)
    assert placed[0] is problem.cameras[0]
    moved = placed[1].pose.position_rig_mm - cameras[1].pose.position_rig_mm
    np.testing.assert_allclose(moved, 0.01 * problem.length_mm, rtol=1e-9)
