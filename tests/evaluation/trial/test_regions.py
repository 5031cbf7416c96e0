"""Regions of a face, predicted against measured, and what two cameras see, where it is known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from matching_scenes import looking_at_origin

from evaluation.trial.regions import face_regions, region_figures
from evaluation.trial.seen import seen_by_two
from geometry.camera import Camera, RigCamera
from geometry.raycast import Occluder
from rig.specification.examples import example_rig

NOSE = np.array([1.0, -80.0, 5.0])


def test_every_point_lies_in_one_region_and_sides_are_the_subjects() -> None:
    rng = np.random.default_rng(2)
    points = NOSE + rng.uniform(-95.0, 95.0, (500, 3))
    regions = face_regions(points, NOSE)
    assert np.array_equal(sum(r.astype(int) for r in regions.values()), np.ones(500))
    # X of the rig's frame points to the subject's left, Z up.
    spots = NOSE + np.array([[50.0, 0, 0], [-50.0, 0, 0], [0, 0, 60.0], [0, 0, 0], [0, 0, -30.0]])
    names = ["left cheek", "right cheek", "forehead", "nose and eyes", "mouth and chin"]
    found = face_regions(spots, NOSE)
    assert [next(n for n, r in found.items() if r[k]) for k in range(5)] == names


def test_a_prediction_that_is_half_the_truth_is_told_by_region() -> None:
    rng = np.random.default_rng(3)
    points = NOSE + rng.uniform(-95.0, 95.0, (40_000, 3))
    left = face_regions(points, NOSE)["left cheek"]
    sigma = rng.uniform(0.01, 0.03, len(points))
    error = rng.normal(0.002, sigma * np.where(left, 2.0, 1.0))
    told = {r.name: r for r in region_figures(points, error, sigma, NOSE)}
    # A robust scatter of n points is known to 1.17 / sqrt(2 n): of the 2,900 or more in the
    # smallest region to 1.5 %; three times that.
    assert told["left cheek"].ratio == pytest.approx(0.5, rel=0.05)
    assert told["right cheek"].ratio == pytest.approx(1.0, rel=0.05)
    assert told["all"].points == len(points)
    assert told["forehead"].predicted_mm == pytest.approx(0.02, rel=0.03)
    # Standard error of the mean at 40,000 points of 0.03 mm: 0.00015 mm; three times that.
    assert told["all"].bias_mm == pytest.approx(0.002, abs=0.0005)
    few = region_figures(points[:60], error[:60], sigma[:60], NOSE)
    assert [r.name for r in few] == ["all"]


def camera(azimuth_deg: float, kind: Camera) -> RigCamera:
    turn = np.radians(azimuth_deg)
    place = 600.0 * np.array([np.sin(turn), -np.cos(turn), 0.0])
    return RigCamera(f"c{azimuth_deg:g}", kind, looking_at_origin(place.tolist()), 600.0)


def test_seen_is_what_two_cameras_see_and_nothing_hides() -> None:
    kind = example_rig("face").camera
    ball = trimesh.creation.icosphere(4, 40.0)
    places, normals = np.asarray(ball.triangles_center), np.asarray(ball.face_normals)
    alone = Occluder(np.asarray(ball.vertices), np.asarray(ball.faces))
    pair = [camera(-20.0, kind), camera(20.0, kind)]
    seen = seen_by_two(places, normals, pair, alone)
    ray = np.array([c.pose.position_rig_mm for c in pair])[:, None] - places
    ray /= np.linalg.norm(ray, axis=2, keepdims=True)
    slant = np.degrees(np.arccos(np.einsum("cni,ni->cn", ray, normals))).max(axis=0)
    # A ball hides nothing of itself that faces the camera.
    assert np.array_equal(seen, slant <= 70.0)
    assert not seen_by_two(places, normals, pair[:1], alone).any()
    wall = trimesh.creation.box((200.0, 1.0, 200.0))
    wall.apply_translation([0.0, -100.0, 0.0])
    both = trimesh.util.concatenate([ball, wall])
    behind = Occluder(np.asarray(both.vertices), np.asarray(both.faces))
    assert not seen_by_two(places, normals, pair, behind).any()
