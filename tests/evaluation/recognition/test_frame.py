"""A face finds its own frame, however it is turned, and says so where it cannot."""

from __future__ import annotations

import numpy as np
import pytest
from recognition_faces import front
from scipy.spatial.transform import Rotation

from common.errors import InputError
from evaluation.recognition.frame import FaceFrame, face_frame
from geometry.arrays import Floats


@pytest.fixture(scope="module")
def straight() -> FaceFrame:
    points, tip = front()
    return face_frame(points, tip, np.eye(3))


def turned(points: Floats, tip: Floats, degrees: list[float]) -> Floats:
    return (points - tip) @ Rotation.from_rotvec(np.radians(degrees)).as_matrix().T + tip


def angle_deg(one: Floats, other: Floats) -> float:
    return float(np.degrees(np.linalg.norm(Rotation.from_matrix(one @ other.T).as_rotvec())))


@pytest.mark.parametrize("degrees", [[8.0, 0.0, 0.0], [0.0, -9.0, 0.0], [3.0, 5.0, 7.0]])
def test_a_turned_face_has_the_same_frame(straight: FaceFrame, degrees: list[float]) -> None:
    points, tip = front()
    found = face_frame(turned(points, tip, degrees), tip + np.array([2.0, 0.0, -3.0]), np.eye(3))
    own = Rotation.from_rotvec(np.radians(degrees)).as_matrix()
    # It stops when a step moves less than 0.02 degrees and 0.03 mm, of which 0.6 are taken;
    # points of the grid fall differently, which a turn of 0.1 degrees (0.1 mm at the rim) covers.
    assert angle_deg(found.axes, straight.axes @ own.T) < 0.1
    assert np.linalg.norm(found.origin_mm - (own @ (straight.origin_mm - tip) + tip)) < 0.1


def test_noise_and_holes_move_it_by_little(straight: FaceFrame) -> None:
    points, tip = front()
    rng = np.random.default_rng(1)
    noisy = points + 0.1 * rng.normal(size=points.shape)
    for hole in ([30.0, 20.0, 25.0], [-40.0, 30.0, -20.0], [10.0, 10.0, -45.0]):
        noisy = noisy[np.linalg.norm(noisy - tip - hole, axis=1) > 13.0]
    found = face_frame(noisy, tip, np.eye(3))
    # The bridge, 18 mm long, has some 25 points of 0.1 mm: 0.1 / 5 / (18 / 12^0.5) = 0.2 degrees.
    assert angle_deg(found.axes, straight.axes) < 3.0 * 0.2
    assert np.linalg.norm(found.origin_mm - straight.origin_mm) < 0.3


@pytest.mark.parametrize(
    ("centre", "radius_mm", "words"),
    [
        ((0.0, 0.0, 0.0), 13.0, "nose"),
        ((0.0, 8.0, 20.0), 14.0, "nose"),
        ((510.0, 0.0, 0.0), 505.0, "both sides|of the face was measured"),
        ((0.0, 0.0, 0.0), 60.0, "of the face was measured"),
    ],
    ids=["tip", "bridge", "half", "middle"],
)
def test_what_is_missing_is_said(
    centre: tuple[float, float, float], radius_mm: float, words: str
) -> None:
    points, tip = front()
    left = points[np.linalg.norm(points - tip - np.array(centre), axis=1) > radius_mm]
    with pytest.raises(InputError, match=words) as refused:
        face_frame(left, tip, np.eye(3))
    assert "capture the face again" in str(refused.value)


def test_a_ball_is_no_face() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(60_000, 3))
    points *= 90.0 / np.linalg.norm(points, axis=1, keepdims=True)
    points = points[points[:, 1] < 0.0]
    with pytest.raises(InputError, match="not certain"):
        face_frame(points, np.array([0.0, -90.0, 0.0]), np.eye(3))
