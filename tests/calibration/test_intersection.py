"""Forward intersection, and the covariance that the design predicts against what noise does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rigs

from calibration.intersection import intersect
from common.errors import InputError
from geometry.camera import RigCamera
from geometry.frames import Pose
from solver.limits import Coverage
from solver.problem import Scene
from solver.quality import Sightings, evaluate

DRAWS = 2000
SIGMA_PX = 0.5


def rig(count: int, distortion: tuple[float, ...] = (0.0,) * 5) -> tuple[RigCamera, ...]:
    camera = rigs.compact_camera(distortion=np.array(distortion))
    angles = np.radians(np.linspace(-35.0, 35.0, count))
    out = []
    for k, a in enumerate(angles):
        place = 900.0 * np.array([np.sin(a), -np.cos(a), 0.25 * (-1) ** k])
        out.append(RigCamera(f"cam{k:02d}", camera, Pose.looking_at(place, np.zeros(3)), 900.0))
    return tuple(out)


@pytest.mark.parametrize("distortion", [(0.0,) * 5, (-0.12, 0.05, 1e-3, -5e-4, 0.01)])
def test_exact_images_give_back_the_points(distortion: tuple[float, ...]) -> None:
    cameras = rig(5, distortion)
    points = rigs.ellipsoid_points(50, 4).points_mm
    pixels = np.stack([c.camera.project(c.pose, points)[0] for c in cameras])
    found = intersect(cameras, pixels, np.ones((5, 50), bool))
    # Rounding: 1e-16 of 1e3 px, times a ground sample distance of 0.1 mm, times a weak geometry.
    np.testing.assert_allclose(found, points, atol=1e-8)


def test_a_point_seen_once_is_not_a_point() -> None:
    cameras = rig(3)
    points = np.zeros((2, 3))
    pixels = np.stack([c.camera.project(c.pose, points)[0] for c in cameras])
    seen = np.array([[True, True], [False, True], [False, True]])
    found = intersect(cameras, pixels, seen)
    assert np.isnan(found[0]).all()
    assert np.isfinite(found[1]).all()


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(InputError, match="do not fit"):
        intersect(rig(3), np.zeros((2, 4, 2)), np.ones((3, 4), bool))


@pytest.mark.slow
def test_predicted_covariance_agrees_with_monte_carlo() -> None:
    subject = rigs.face(60, 60)
    cameras = rig(6)
    limits = rigs.face_limits(image_sigma_px=SIGMA_PX, coverage=Coverage(unseen_sigma_mm=1e5))
    quality = evaluate(subject, cameras, limits)
    scene = Scene(subject, cameras, limits)
    seen = Sightings.of(scene, scene.visibility_positions[0]).framed
    points = subject.check_points.points_mm
    exact = np.stack([c.camera.project(c.pose, points)[0] for c in cameras])
    rng = np.random.default_rng(11)
    errors = np.empty((DRAWS, len(points), 3))
    for draw in range(DRAWS):
        noisy = exact + SIGMA_PX * rng.normal(size=exact.shape)
        errors[draw] = intersect(cameras, noisy, seen) - points
    used = quality.points.views >= 2
    assert used.sum() > 50
    sampled = np.einsum("dpk,dpm->pkm", errors[:, used], errors[:, used]) / DRAWS
    predicted = quality.points.covariance_mm2[used]
    # Each variance estimate scatters by sqrt(2 / 2000) = 3.2 %, its root by 1.6 %; the worst of
    # 60 x 3 lies within 3.5 of those. The customer's limit is 10 %.
    ratio = np.sqrt(np.einsum("pkk->pk", sampled) / np.einsum("pkk->pk", predicted))
    assert np.abs(ratio - 1.0).max() < 0.10
    assert abs(np.sqrt(ratio.mean()) - 1.0) < 0.01
    whole = np.linalg.norm(sampled - predicted, axis=(1, 2)) / np.linalg.norm(
        predicted, axis=(1, 2)
    )
    assert np.median(whole) < 0.10


def test_monte_carlo_notices_a_wrong_sigma() -> None:
    """The comparison above has teeth: half the noise is far outside its limits."""
    subject = rigs.face(30, 30)
    cameras = rig(4)
    limits = rigs.face_limits(coverage=Coverage(unseen_sigma_mm=1e5))
    right = evaluate(subject, cameras, limits).points.sigma_mm
    wrong = evaluate(subject, cameras, replace(limits, image_sigma_px=1.0)).points.sigma_mm
    assert np.median(wrong / right) == pytest.approx(2.0, rel=1e-3)
