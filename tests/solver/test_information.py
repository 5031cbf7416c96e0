"""Information of rays and covariance of points: laws that hold for every camera and point."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from geometry.frames import PHOTO_TO_CV, look_at_rotation
from solver.information import CovarianceCost, normal_matrices, ray_information, symmetric
from solver.variables import NetworkState, Unknowns

seeds = st.integers(0, 10_000)
PRIOR = 0.7


def network(seed: int, cameras: int = 3, points: int = 5) -> tuple[NetworkState, np.ndarray]:
    """Cameras about one length away that look at points about the origin."""
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(cameras, 3))
    centres *= (1.0 + 0.3 * rng.random(cameras) / 1.0)[:, None] / np.linalg.norm(
        centres, axis=1, keepdims=True
    )
    rotations = np.stack([look_at_rotation(c, np.zeros(3), 360.0 * rng.random()) for c in centres])
    unknowns = Unknowns(PHOTO_TO_CV @ rotations, np.zeros(3), 1.0, np.arange(7 * cameras))
    values = np.zeros((cameras, 7))
    values[:, 3:6], values[:, 6] = centres, 1.0
    return unknowns.state(values.ravel()), 0.2 * rng.uniform(-1.0, 1.0, (points, 3))


def weights(seed: int, cameras: int = 3, points: int = 5) -> np.ndarray:
    rng = np.random.default_rng(seed + 1)
    return rng.uniform(10.0, 100.0, (cameras, points)) * (rng.random((cameras, points)) < 0.8)


def by_steps(state: NetworkState, i: int, point: np.ndarray) -> np.ndarray:
    """One ray's information from the image coordinates' differences, for (f / s)**2 = 1."""

    def image(at: np.ndarray) -> np.ndarray:
        x, y, z = state.rotation[i] @ (at - state.centre[i])
        return np.array([x / z, y / z])

    step = 1e-5
    slope = np.stack(
        [(image(point + step * e) - image(point - step * e)) / (2 * step) for e in np.eye(3)], 1
    )
    return slope.T @ slope


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seeds)
def test_a_ray_carries_what_its_image_coordinates_tell(seed: int) -> None:
    state, points = network(seed)
    weight = weights(seed)
    entries = ray_information(state, points, weight)
    for i in range(3):
        for k, matrix in enumerate(symmetric(entries[i])):
            expected = weight[i, k] * by_steps(state, i, points[k])
            # Steps err by 1e-10 f''' / 6 and by rounding of 1e-16 / 1e-5, times weights of 100.
            np.testing.assert_allclose(matrix, expected, atol=1e-6)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seeds)
def test_a_ray_tells_nothing_along_itself_and_something_across(seed: int) -> None:
    state, points = network(seed, 1)
    entries = ray_information(state, points, np.ones((1, 5)))
    for point, matrix in zip(points, symmetric(entries[0]), strict=True):
        ray = point - state.centre[0]
        np.testing.assert_allclose(matrix @ ray, 0.0, atol=1e-12)
        size = np.linalg.eigvalsh(matrix)
        assert size[0] == pytest.approx(0.0, abs=1e-12)
        assert size[1] > 0.1


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seeds)
def test_information_adds_up_with_what_was_known_before(seed: int) -> None:
    state, points = network(seed)
    weight = weights(seed)
    rays = ray_information(state, points, weight)
    whole = normal_matrices(state, points, weight, PRIOR)
    np.testing.assert_allclose(
        whole, symmetric(rays.sum(axis=0)) + PRIOR * np.eye(3), rtol=1e-9, atol=1e-9
    )


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seeds)
def test_the_cost_is_the_mean_norm_and_no_view_ever_raises_it(seed: int) -> None:
    state, points = network(seed)
    weight = weights(seed)
    covariance = np.linalg.inv(normal_matrices(state, points, weight, PRIOR))
    norms = [np.linalg.norm(np.linalg.eigvalsh(q)) for q in covariance]
    cost = CovarianceCost(points, weight, PRIOR)
    assert cost.value(state) == pytest.approx(np.mean(norms))
    assert cost.typical(state) == pytest.approx(np.median(norms))
    scaled = CovarianceCost(points, weight, PRIOR, 4.0)
    assert scaled.value(state) == pytest.approx(np.mean(norms) / 4.0)
    np.testing.assert_allclose(scaled.gradient(state), cost.gradient(state) / 4.0)
    np.testing.assert_allclose(scaled.hessian(state), cost.hessian(state) / 4.0)
    for i in range(3):
        blind = weight.copy()
        blind[i] = 0.0
        assert CovarianceCost(points, blind, PRIOR).value(state) >= cost.value(state) - 1e-12


@settings(max_examples=6, deadline=None, derandomize=True)
@given(seeds)
def test_derivatives_match_central_differences_wherever_cameras_stand(seed: int) -> None:
    state, points = network(seed)
    cost = CovarianceCost(points, weights(seed), PRIOR)
    unknowns = Unknowns(
        np.linalg.inv(PHOTO_TO_CV) @ state.rotation, np.zeros(3), 1.0, np.arange(21)
    )
    at = np.zeros((3, 7))
    at[:, 3:6], at[:, 6] = state.centre, state.focus
    at = at.ravel()
    np.testing.assert_allclose(unknowns.state(at).rotation, state.rotation, atol=1e-12)
    step = 1e-5

    def sides(function):  # noqa: ANN001, ANN202
        moves = step * np.eye(21)
        return np.stack(
            [
                (function(unknowns.state(at + e)) - function(unknowns.state(at - e))) / (2 * step)
                for e in moves
            ]
        )

    gradient, hessian = cost.gradient(state), cost.hessian(state)
    # step**2 / 6 of third derivatives of order 1e3 of the cost, as in the tests of the rows.
    np.testing.assert_allclose(gradient, sides(cost.value), atol=1e-6 * np.abs(gradient).max())
    np.testing.assert_allclose(hessian, sides(cost.gradient), atol=1e-6 * np.abs(hessian).max())
    np.testing.assert_allclose(hessian, hessian.T, atol=1e-9 * np.abs(hessian).max())
    # The focus distance has no say.
    assert not gradient.reshape(3, 7)[:, 6].any()
    assert not hessian.reshape(3, 7, 21)[:, 6].any()


@settings(max_examples=6, deadline=None, derandomize=True)
@given(seeds)
def test_a_turn_about_the_axis_changes_nothing(seed: int) -> None:
    state, points = network(seed)
    turn = Rotation.from_euler("z", np.random.default_rng(seed).uniform(0, 6, 3)[:, None])
    rolled = NetworkState(
        turn.as_matrix() @ state.rotation,
        state.rotation_1,
        state.rotation_2,
        state.centre,
        state.focus,
    )
    weight = weights(seed)
    np.testing.assert_allclose(
        ray_information(rolled, points, weight), ray_information(state, points, weight), atol=1e-10
    )


def test_a_point_in_a_blind_cameras_own_plane_poisons_nothing() -> None:
    state, points = network(3)
    beside = np.cross(state.axis[0], [0.3, 0.5, 0.8]) + state.centre[0]
    points = np.concatenate([points, beside[None]])
    weight = np.full((3, 6), 50.0)
    weight[:, 5] = 0.0
    cost = CovarianceCost(points, weight, PRIOR)
    alone = CovarianceCost(points[:5], weight[:, :5], PRIOR)
    # An unseen point costs sqrt(3) of what is known of it beforehand.
    expected = (5.0 * alone.value(state) + np.sqrt(3.0) / PRIOR) / 6.0
    assert cost.value(state) == pytest.approx(expected)
    assert np.isfinite(cost.gradient(state)).all()
    np.testing.assert_allclose(cost.gradient(state), 5.0 / 6.0 * alone.gradient(state))
