"""The figures of a network against plain readings: point by point, ray by ray, pixel by pixel."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import rigs
from scipy.spatial.transform import Rotation

from common.errors import InputError
from geometry.camera import RigCamera
from geometry.frames import Pose
from geometry.optics import blur_disk_mm
from geometry.raycast import Occluder
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from solver.limits import Coverage, CoverageTier, Incidence, Limits, MotionBox
from solver.matching import Matching
from solver.motion import rest
from solver.problem import Problem
from solver.quality import (
    Observations,
    base_height_table,
    convergence_table,
    evaluate,
    is_sharp,
    keeps_limits,
    nearest_body_mm,
)
from solver.result import Quality

OFF = Limits(
    incidence=Incidence(70.0),
    frame=None,
    depth_of_field=False,
    body_clearance_mm=None,
    sight_line_clearance_mm=None,
)
SIGMA_PX = 0.5
FOCAL_PX = 50.0 / (23.1 / 4000)


@cache
def network() -> tuple[Subject, tuple[RigCamera, ...], Quality]:
    """Four cameras, of which the last sees a part of the face only, and how they score."""
    subject = rigs.face(30, 60)
    cameras = list(rigs.face_cameras(subject, 4))
    turned = Rotation.from_euler("y", 12.0, degrees=True).as_matrix()
    pose = cameras[3].pose
    cameras[3] = cameras[3].moved_to(
        Pose(pose.position_rig_mm, turned @ pose.rotation_rig_to_camera), 600.0
    )
    found = tuple(cameras)
    return subject, found, evaluate(subject, found, rigs.face_limits())


@pytest.mark.parametrize(
    ("changes", "broken"),
    [
        ({}, set()),
        ({"coverage": Coverage((CoverageTier(4, 0.9),))}, {"coverage_4"}),
        ({"gsd_max_mm": 0.01}, {"gsd"}),
        ({"matching": Matching(max_angle_deg=1.0, required=True)}, {"groups", "matchable_1"}),
        ({"matching": Matching(max_angle_deg=1.0)}, set()),
    ],
)
def test_whether_limits_are_kept_is_what_the_whole_evaluation_says(
    changes: dict[str, object], broken: set[str]
) -> None:
    subject, cameras, _ = network()
    limits = replace(OFF, **({"coverage": Coverage(())} | changes))
    whole = evaluate(subject, cameras, limits)
    assert {row.family for row in whole.violated} == broken
    assert keeps_limits(subject, cameras, limits) == whole.feasible == (not broken)


def seen_by_hand(subject: Subject, camera: RigCamera) -> np.ndarray:
    """Facing within 70 degrees, nothing in the way, inside the image."""
    source, out = subject.check_points, []
    for point, normal in zip(source.points_mm, source.normals, strict=True):
        ray = camera.pose.position_rig_mm - point
        facing = normal @ ray / np.linalg.norm(ray) >= np.cos(np.radians(70.0))
        hidden = subject.occluder.hidden(point[None], normal[None], camera.pose.position_rig_mm)[0]
        (pixel,), (depth,) = camera.camera.project(camera.pose, point[None])
        inside = (-0.5 < pixel[0] < 3999.5) and (-0.5 < pixel[1] < 2666.5) and depth > 0.0
        out.append(bool(facing and not hidden and inside))
    return np.array(out)


def test_the_planted_camera_sees_a_part_only() -> None:
    _, _, quality = network()
    seen = quality.cameras.points_seen
    assert 0 < seen[3] < 0.9 * seen[:3].min()
    assert quality.in_frame_share < 1.0
    assert quality.in_focus_share < 1.0


def test_views_are_counted_ray_by_ray() -> None:
    subject, cameras, quality = network()
    seen = np.array([seen_by_hand(subject, c) for c in cameras])
    np.testing.assert_array_equal(quality.points.views, seen.sum(axis=0))
    np.testing.assert_array_equal(quality.cameras.points_seen, seen.sum(axis=1))
    for row in quality.coverage:
        assert row.share == (seen.sum(axis=0) >= row.views).mean()
    assert [row.views for row in quality.coverage] == [1, 2, 3]


def test_covariances_are_those_of_the_collinearity_equations_differentiated_by_steps() -> None:
    subject, cameras, quality = network()
    seen = np.array([seen_by_hand(subject, c) for c in cameras])
    step = 1e-3
    for k in range(0, 60, 7):
        point = subject.check_points.points_mm[k]
        normal = np.eye(3)  # an unseen point has a sigma of 1 mm
        for camera in (c for c, s in zip(cameras, seen[:, k], strict=True) if s):
            moved = point + step * np.concatenate([np.eye(3), -np.eye(3)])
            pixels, _ = camera.camera.project(camera.pose, moved)
            slope = (pixels[:3] - pixels[3:]).T / (2.0 * step)
            normal += slope.T @ slope / SIGMA_PX**2
        expected = np.linalg.inv(normal)
        # Steps of 1e-3 mm at 700 mm err by 1e-12, pixels round at 1e-12 / 1e-3 of slopes of 10.
        np.testing.assert_allclose(
            quality.points.covariance_mm2[k], expected, rtol=1e-6, atol=1e-7 * expected.max()
        )


def test_the_summary_is_of_the_points() -> None:
    _, _, quality = network()
    sigma = np.sqrt([np.linalg.eigvalsh(q).max() for q in quality.points.covariance_mm2])
    np.testing.assert_allclose(quality.points.sigma_mm, sigma, rtol=1e-9)
    norms = [np.linalg.norm(np.linalg.eigvalsh(q)) for q in quality.points.covariance_mm2]
    assert quality.cost_mm2 == pytest.approx(np.mean(norms))
    ordered = np.sort(sigma)
    assert quality.sigma_max_mm == pytest.approx(ordered[-1])
    assert quality.sigma_median_mm == pytest.approx(0.5 * (ordered[29] + ordered[30]))
    # The 95 % point of 60 values lies 0.05 of the way from the 57th to the 58th.
    assert quality.sigma_p95_mm == pytest.approx(0.95 * ordered[56] + 0.05 * ordered[57])


def test_each_camera_tells_depths_angles_and_pixels_of_what_it_sees() -> None:
    subject, cameras, quality = network()
    source, middle = subject.check_points, subject.design_points.centroid_mm
    for i, camera in enumerate(cameras):
        mine = np.flatnonzero(seen_by_hand(subject, camera))
        depth = camera.pose.to_camera(source.points_mm[mine])[:, 2]
        np.testing.assert_allclose(quality.cameras.depth_mm[i], [depth.min(), depth.max()])
        gsd = [depth.min(), depth.mean(), depth.max()] / np.array(FOCAL_PX)
        np.testing.assert_allclose(quality.cameras.gsd_mm[i], gsd)
        ray = camera.pose.position_rig_mm - source.points_mm[mine]
        cosine = (ray * source.normals[mine]).sum(axis=1) / np.linalg.norm(ray, axis=1)
        angle = np.degrees(np.arccos(cosine))
        np.testing.assert_allclose(quality.cameras.incidence_deg[i], [angle.mean(), angle.max()])
        away = np.linalg.norm(camera.pose.position_rig_mm - middle)
        assert quality.cameras.distance_mm[i] == pytest.approx(away)
        near, far = quality.cameras.focus_mm[i]
        blur = blur_disk_mm(np.array([near, far]), camera.focus_distance_mm, 50.0, 16.0)
        np.testing.assert_allclose(blur, camera.camera.circle_of_confusion_mm)
    sharp = [
        is_sharp(c, c.pose.to_camera(source.points_mm)[:, 2]) & seen_by_hand(subject, c)
        for c in cameras
    ]
    np.testing.assert_array_equal(quality.points.in_focus, np.sum(sharp, axis=0))
    total = quality.cameras.points_seen.sum()
    assert quality.in_focus_share == pytest.approx(np.sum(sharp) / total)


def test_a_camera_that_sees_nothing_has_no_figures_and_adds_nothing() -> None:
    subject, cameras, _ = network()
    away = RigCamera(
        "away",
        rigs.compact_camera(),
        Pose.looking_at(np.array([0.0, -800.0, 0.0]), np.array([0.0, -2000.0, 0.0])),
        900.0,
    )
    with_it, without = (evaluate(subject, c, OFF) for c in ((*cameras, away), cameras))
    assert with_it.cameras.points_seen[-1] == 0
    assert np.isnan(with_it.cameras.gsd_mm[-1]).all()
    assert np.isnan(with_it.cameras.depth_mm[-1]).all()
    assert with_it.cost_mm2 == pytest.approx(without.cost_mm2, rel=1e-9)
    alone = evaluate(subject, (away,), OFF)
    np.testing.assert_allclose(alone.points.sigma_mm, 1.0)
    assert alone.cost_mm2 == pytest.approx(np.sqrt(3.0))
    assert alone.in_focus_share == alone.in_frame_share == 0.0


def test_more_cameras_never_know_less() -> None:
    subject, cameras, quality = network()
    before = np.inf
    for n in range(1, 5):
        found = evaluate(subject, cameras[:n], OFF)
        assert found.cost_mm2 < before
        before = found.cost_mm2
    assert before == pytest.approx(quality.cost_mm2, rel=1e-9)


def test_the_same_rig_elsewhere_has_the_same_figures() -> None:
    subject, cameras, quality = network()
    turn = Rotation.from_rotvec([0.4, -0.2, 0.7]).as_matrix()
    shift = np.array([120.0, -40.0, 15.0])

    def moved(points: SurfacePoints) -> SurfacePoints:
        return SurfacePoints(points.points_mm @ turn.T + shift, points.normals @ turn.T)

    vertices, faces = rigs.ellipsoid_mesh()
    there = Subject(
        moved(subject.design_points),
        moved(subject.check_points),
        Occluder(vertices @ turn.T + shift, faces),
    )
    carried = tuple(
        c.moved_to(
            Pose(turn @ c.pose.position_rig_mm + shift, c.pose.rotation_rig_to_camera @ turn.T),
            c.focus_distance_mm,
        )
        for c in cameras
    )
    found = evaluate(there, carried, rigs.face_limits())
    np.testing.assert_allclose(found.points.sigma_mm, quality.points.sigma_mm, rtol=1e-6)
    np.testing.assert_allclose(found.base_height, quality.base_height, atol=1e-9)
    assert found.coverage == quality.coverage


def test_coverage_is_that_of_the_worst_head_position() -> None:
    subject, cameras, quality = network()
    box = MotionBox(x_mm=60.0, yaw_deg=25.0)
    tiers = Coverage((CoverageTier(4, 0.1),))
    limits = replace(rigs.face_limits(), motion=box, coverage=tiers)
    moving = evaluate(subject, cameras, limits)
    assert [row.views for row in moving.coverage] == [1, 2, 3, 4]
    problem = Problem(subject, cameras, limits)
    for row in moving.coverage:
        shares = [
            (Observations.of(problem, p).framed.sum(axis=0) >= row.views).mean()
            for p in problem.visibility_positions
        ]
        assert row.share == min(shares)
    assert moving.coverage[1].share < quality.coverage[1].share
    # Accuracy is told for the head at rest.
    assert moving.cost_mm2 == pytest.approx(quality.cost_mm2, rel=1e-12)


def test_observations_narrow_from_visible_to_framed_to_sharp() -> None:
    subject, cameras, _ = network()
    problem = Problem(subject, cameras, rigs.face_limits())
    found = Observations.of(problem, rest(problem.origin_mm))
    assert (found.visible >= found.framed).all()
    assert (found.framed >= found.sharp).all()
    assert found.visible.sum() > found.framed.sum() > found.sharp.sum() > 0


def test_sharpness_ends_at_the_limits_of_the_depth_of_field() -> None:
    camera = network()[1][0]
    ratio = 2 * 23.1 / 4000 * 16.0 * (camera.focus_distance_mm - 50.0) / 2500.0
    near, far = camera.focus_distance_mm / (1.0 + ratio), camera.focus_distance_mm / (1.0 - ratio)
    depths = np.array([near * 0.9999, near * 1.0001, far * 0.9999, far * 1.0001, 0.0, -near])
    assert is_sharp(camera, depths).tolist() == [False, True, True, False, False, False]


def test_tables_of_pairs_are_symmetric_and_hand_computed() -> None:
    _, cameras, quality = network()
    middle = np.array([5.0, 0.0, -3.0])
    bases, angles = base_height_table(cameras, middle), convergence_table(cameras, middle)
    for table in (bases, angles, quality.base_height, quality.convergence_deg):
        np.testing.assert_array_equal(table, table.T)
        np.testing.assert_array_equal(np.diag(table), 0.0)
    one, two = (c.pose.position_rig_mm - middle for c in cameras[1:3])
    lengths = np.linalg.norm(one), np.linalg.norm(two)
    assert bases[1, 2] == pytest.approx(np.linalg.norm(one - two) / np.mean(lengths))
    assert angles[1, 2] == pytest.approx(np.degrees(np.arccos(one @ two / np.prod(lengths))))


def test_the_nearest_body_is_the_least_gap_between_covers() -> None:
    subject, cameras, _ = network()
    assert nearest_body_mm(Problem(subject, cameras[:1], OFF)).tolist() == [np.inf]
    beside = cameras[0].pose
    twin = RigCamera(
        "twin", cameras[0].camera, Pose(beside.to_rig(np.array([200.0, 0, 0])),
        beside.rotation_rig_to_camera), 900.0,
    )  # fmt: skip
    gap = nearest_body_mm(Problem(subject, (cameras[0], twin), OFF))
    # Bodies 62 mm wide side by side, 200 mm apart; each cover reaches up to 20 mm beyond.
    assert gap[0] == gap[1]
    assert 138.0 - 40.0 <= gap[0] <= 138.0


def test_nobody_and_namesakes_are_refused() -> None:
    subject, cameras, _ = network()
    with pytest.raises(InputError, match="no cameras"):
        evaluate(subject, (), OFF)
    with pytest.raises(InputError, match="same name"):
        evaluate(subject, (cameras[0], replace(cameras[1], name=cameras[0].name)), OFF)
