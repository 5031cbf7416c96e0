"""The collinearity equations: beside the camera model of the ground floor, and their partials."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.adjustment.camera import INTERIOR, PER_CAMERA, CalibratedCamera, Interior
from calibration.adjustment.model import ObservationIndex, partials, project
from calibration.adjustment.rotations import rotation_of, similarity, vector_of
from calibration.adjustment.state import State
from geometry.arrays import Floats
from geometry.camera import distort
from geometry.frames import Pose


def state(seed: int, terms: float = 1.0) -> State:
    """Two cameras that look at five targets on a carrier in two places."""
    rng = np.random.default_rng(seed)
    interior = np.array([1500.0, 640.0, 480.0, -0.2, 0.08, 1e-3, -2e-3, 0.03, 2e-3])
    interior = np.stack([interior * (1.0 + 0.1 * rng.normal(size=9)) for _ in range(2)])
    interior[:, 3:] *= terms
    # The first is a rational lens, the other Brown's.
    more = np.array([[0.1 * terms, 0.02 * terms, -0.01 * terms, 1.0], [0.0] * 4])
    interior = np.concatenate([interior, more], axis=1)
    poses = [Pose.looking_at(np.array([x, -900.0, 30.0]), np.zeros(3)) for x in (-200.0, 250.0)]
    return State(
        interior,
        np.stack([p.position_rig_mm for p in poses]),
        np.stack([p.rotation_rig_to_camera for p in poses]),
        rng.normal(size=(2, 3)) * 20.0,
        rotation_of(rng.normal(size=(2, 3))),
        rng.uniform(-150.0, 150.0, (5, 3)),
    )


SIGHT = ObservationIndex(
    np.repeat([0, 1], 10).astype(np.int64),
    np.tile(np.repeat([0, 1], 5), 2).astype(np.int64),
    np.tile(np.arange(5), 4).astype(np.int64),
)


def test_pixels_are_those_of_the_ground_floor() -> None:
    given_state = state(1)
    pixel, depth = project(given_state, SIGHT)
    points = given_state.points_rig_mm(SIGHT.pose, SIGHT.target)
    for k in range(len(pixel)):
        c = SIGHT.camera[k]
        values = given_state.interior[c]
        local = given_state.rotation[c] @ (points[k] - given_state.centre[c])
        f, b1 = values[0], values[8]
        terms = np.concatenate([values[3:8], values[9:12] if c == 0 else []])
        plain = distort((local[:2] / local[2])[None], terms)[0]
        expected = plain * [f * (1.0 + b1), f] + values[1:3]
        np.testing.assert_allclose(pixel[k], expected, rtol=1e-13)
        assert depth[k] == pytest.approx(local[2])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_partials_agree_with_central_differences(seed: int) -> None:
    given_state = state(seed)
    parts = partials(given_state, SIGHT)
    np.testing.assert_array_equal(parts.pixel, project(given_state, SIGHT)[0])
    core_count = 2 * PER_CAMERA + 2 * 6
    number_of_lens = (12, PER_CAMERA + 12)
    for column in set(range(core_count + 15)) - set(number_of_lens):
        # Steps that move the image by about a pixel: the cubic term of a difference is then
        # below 1e-6 of the derivative, rounding below 1e-9 of it.
        step = 1e-3 if column % PER_CAMERA in range(3, 12) and column < 2 * PER_CAMERA else 1e-2
        if column < 2 * PER_CAMERA and column % PER_CAMERA >= 16:
            step = 1e-5
        if 2 * PER_CAMERA <= column < core_count and (column - 2 * PER_CAMERA) % 6 >= 3:
            step = 1e-5
        change = np.zeros(core_count + 15)
        change[column] = step
        sides = []
        for sign in (1.0, -1.0):
            core, target = sign * change[:core_count], sign * change[core_count:].reshape(5, 3)
            sides.append(project(given_state.moved(core, target), SIGHT)[0])
        numeric = (sides[0] - sides[1]) / (2.0 * step)
        analytic = closed_form(parts.camera, parts.pose, parts.target, column)
        scale = max(float(np.abs(numeric).max()), 1e-6)
        np.testing.assert_allclose(analytic / scale, numeric / scale, atol=2e-6)


def closed_form(camera: Floats, pose: Floats, target: Floats, column: int) -> Floats:
    """The closed-form column (n, 2) of one unknown, zero where it does not act."""
    out = np.zeros((len(camera), 2))
    if column < 2 * PER_CAMERA:
        rows = SIGHT.camera == column // PER_CAMERA
        out[rows] = camera[rows, :, column % PER_CAMERA]
    elif column < 2 * PER_CAMERA + 12:
        column -= 2 * PER_CAMERA
        rows = SIGHT.pose == column // 6
        out[rows] = pose[rows, :, column % 6]
    else:
        column -= 2 * PER_CAMERA + 12
        rows = SIGHT.target == column // 3
        out[rows] = target[rows, :, column % 3]
    return out


angles = st.floats(-3.0, 3.0)


@given(st.tuples(angles, angles, angles).map(np.array))
@settings(max_examples=60, deadline=None)
def test_a_rotation_vector_comes_back(vector: Floats) -> None:
    rotation = rotation_of(vector)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    if np.linalg.norm(vector) < 3.1:
        np.testing.assert_allclose(rotation_of(vector_of(rotation)), rotation, atol=1e-9)


def test_a_similarity_comes_back() -> None:
    rng = np.random.default_rng(5)
    points, turn = rng.normal(size=(6, 3)), rotation_of(np.array([0.3, -1.0, 2.0]))
    moved = 1.7 * points @ turn.T + [1.0, 2.0, 3.0]
    scale, rotation, shift = similarity(points, moved, scaled=True)
    assert scale == pytest.approx(1.7)
    np.testing.assert_allclose(rotation, turn, atol=1e-12)
    np.testing.assert_allclose(shift, [1.0, 2.0, 3.0], atol=1e-12)


def test_camera_objects_and_rows_project_alike() -> None:
    given_state = state(4)
    cameras = given_state.cameras(("a", "b"), ((1280, 960), (1280, 960)))
    points = given_state.points_rig_mm(SIGHT.pose, SIGHT.target)
    pixel, _ = project(given_state, SIGHT)
    for k, camera in enumerate(cameras):
        rows = SIGHT.camera == k
        np.testing.assert_allclose(camera.project(points[rows]), pixel[rows], rtol=1e-12)
        ways = camera.rays(pixel[rows])
        away = points[rows] - camera.pose.position_rig_mm
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        np.testing.assert_allclose(ways, away, atol=1e-10)


def test_a_camera_of_impossible_values_is_refused() -> None:
    from common.errors import InputError

    for f, centre, terms in (
        (0.0, [1, 1], [0] * 5),
        (1.0, [1, 1, 1], [0] * 5),
        (1.0, [1, 1], [0] * 6),
    ):
        with pytest.raises(InputError):
            Interior(f, np.array(centre, float), np.array(terms, float))


def test_interior_vectors_come_back() -> None:
    # A rational lens has all terms.
    vector = np.array([*np.arange(1.0, INTERIOR), 1.0])
    np.testing.assert_array_equal(Interior.of(vector).vector, vector)
    camera = CalibratedCamera("a", (10, 10), Interior.of(vector), Pose(np.zeros(3), np.eye(3)))
    assert camera.interior.camera_matrix[0, 0] == pytest.approx(10.0)
