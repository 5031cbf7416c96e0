"""Every block of rows: closed-form derivatives against central differences."""

from __future__ import annotations

import numpy as np
import pytest
import rigs

from solver.constraints.base import Block, WeightedSum
from solver.constraints.bodies import BodyDistance, BodyPairs, BodyPlanes, ViewPlanes
from solver.constraints.positions import (
    BaseHeightRatio,
    BaseLength,
    PositionCones,
    PositionCoordinate,
    PositionDistance,
)
from solver.constraints.rays import (
    FocusRays,
    LevelAxis,
    MeanAxisIncidence,
    MeanImageCoordinate,
    RayPlanes,
)
from solver.information import CovarianceCost
from solver.problem import Problem

CAMERAS = 4
UNKNOWNS = 7 * CAMERAS
STEP = 1e-5
# Central differences err by step**2 f''' / 6 ~ 1e-11 and rounding / step ~ 1e-11; entries are
# of order 1 to 10, so 1e-7 leaves two digits of room.
TOLERANCE = 1e-7


@pytest.fixture(scope="module")
def problem() -> Problem:
    subject = rigs.face(40, 80)
    return Problem(subject, rigs.face_cameras(subject, CAMERAS), rigs.face_limits())


@pytest.fixture(scope="module")
def values(problem: Problem) -> np.ndarray:
    return problem.start_values() + 0.03 * np.random.default_rng(5).normal(size=UNKNOWNS)


def blocks(problem: Problem) -> dict[str, Block]:
    rng = np.random.default_rng(1)
    m = 12
    camera = rng.integers(0, CAMERAS, m)
    other = (camera + 1 + rng.integers(0, CAMERAS - 1, m)) % CAMERAS
    head = {"family": "t", "unit": "", "natural": 1.0, "lower": np.zeros(m), "upper": np.ones(m)}
    per_camera = head | {"lower": np.zeros(CAMERAS), "upper": np.ones(CAMERAS)}

    def vectors(size: float) -> np.ndarray:
        return size * rng.normal(size=(m, 3))

    ratio = BaseHeightRatio(**head, first=camera, second=other, centroid=vectors(0.1))
    every = np.arange(CAMERAS)
    return {
        "ray_planes": RayPlanes(**head, camera=camera, point=vectors(0.1), normal=vectors(1.0)),
        "focus": FocusRays(
            **head,
            camera=camera,
            point=vectors(0.1),
            side=rng.choice([-1.0, 1.0], m),
            blur=np.full(m, 0.1),
            focal=np.full(m, 0.05),
        ),
        "mean_image": MeanImageCoordinate(
            **per_camera,
            camera=every,
            component=np.array([0, 1, 0, 1]),
            points=(problem.points,),
        ),
        "axis_incidence": MeanAxisIncidence(
            **per_camera, camera=every, normals=(problem.subject.design_points.normals,)
        ),
        "level": LevelAxis(**head, camera=camera, axis=rng.integers(0, 2, m)),
        "cones": PositionCones(
            **head, camera=camera, point=vectors(0.1), normal=vectors(1.0), opening=rng.random(m)
        ),
        "distance": PositionDistance(**head, camera=camera, point=vectors(0.1)),
        "coordinate": PositionCoordinate(
            **head, camera=camera, axis=rng.integers(0, 3, m), origin=rng.random(m)
        ),
        "base": BaseLength(**head, first=camera, second=other),
        "base_height": ratio,
        "mean": WeightedSum(
            **(head | {"lower": np.zeros(2), "upper": np.ones(2)}),
            inner=ratio,
            weights=rng.random((2, m)),
            unknowns=UNKNOWNS,
        ),
        "body_planes": BodyPlanes(**head, camera=camera, offset=vectors(0.05), normal=vectors(1.0)),
        "body_distance": BodyDistance(
            **head, camera=camera, offset=vectors(0.05), point=vectors(0.1)
        ),
        "body_pairs": BodyPairs(
            **head,
            first=camera,
            second=other,
            first_offset=vectors(0.05),
            second_offset=vectors(0.05),
        ),
        "sight": ViewPlanes(
            **head, camera=camera, other=other, offset=vectors(0.05), normal=vectors(1.0)
        ),
    }


def dense_jacobian(block: Block, problem: Problem, at: np.ndarray) -> np.ndarray:
    out = np.zeros((block.rows, UNKNOWNS))
    np.put_along_axis(out, block.columns, block.jacobian(problem.unknowns.state(at)), axis=1)
    return out


@pytest.mark.parametrize(
    "name",
    [
        "ray_planes",
        "focus",
        "mean_image",
        "axis_incidence",
        "level",
        "cones",
        "distance",
        "coordinate",
        "base",
        "base_height",
        "mean",
        "body_planes",
        "body_distance",
        "body_pairs",
        "sight",
    ],
)
def test_derivatives_match_central_differences(
    name: str, problem: Problem, values: np.ndarray
) -> None:
    block = blocks(problem)[name]
    units = np.eye(UNKNOWNS)

    def value(at: np.ndarray) -> np.ndarray:
        return block.value(problem.unknowns.state(at))

    numeric = np.stack(
        [(value(values + STEP * e) - value(values - STEP * e)) / (2 * STEP) for e in units], axis=1
    )
    jacobian = dense_jacobian(block, problem, values)
    assert np.abs(jacobian).max() > 0.01
    np.testing.assert_allclose(jacobian, numeric, atol=TOLERANCE * max(1.0, np.abs(jacobian).max()))

    weights = np.random.default_rng(2).normal(size=block.rows)
    hessian = np.zeros((UNKNOWNS, UNKNOWNS))
    block.add_hessian(problem.unknowns.state(values), weights, hessian)
    by_step = [
        weights
        @ (
            dense_jacobian(block, problem, values + STEP * e)
            - dense_jacobian(block, problem, values - STEP * e)
        )
        for e in units
    ]
    np.testing.assert_allclose(
        hessian,
        np.stack(by_step) / (2 * STEP),
        atol=10 * TOLERANCE * max(1.0, np.abs(hessian).max()),
    )


def test_cost_derivatives_match_central_differences(problem: Problem, values: np.ndarray) -> None:
    weight = np.broadcast_to(problem.ray_weight[:, None], (CAMERAS, len(problem.points)))
    cost = CovarianceCost(problem.points, weight, problem.prior)
    cost = CovarianceCost(
        problem.points, weight, problem.prior, cost.typical(problem.unknowns.state(values))
    )
    units = np.eye(UNKNOWNS)

    def gradient(at: np.ndarray) -> np.ndarray:
        return cost.gradient(problem.unknowns.state(at))

    def value(at: np.ndarray) -> float:
        return cost.value(problem.unknowns.state(at))

    state = problem.unknowns.state(values)
    numeric = np.array(
        [(value(values + STEP * e) - value(values - STEP * e)) / (2 * STEP) for e in units]
    )
    np.testing.assert_allclose(cost.gradient(state), numeric, atol=1e-6 * np.abs(numeric).max())
    second = np.stack(
        [(gradient(values + STEP * e) - gradient(values - STEP * e)) / (2 * STEP) for e in units]
    )
    np.testing.assert_allclose(cost.hessian(state), second, atol=1e-6 * np.abs(second).max())


def test_a_point_behind_a_camera_is_not_a_number(problem: Problem, values: np.ndarray) -> None:
    weight = np.ones((CAMERAS, 1))
    behind = 2.0 * problem.unknowns.state(values).centre[:1]
    cost = CovarianceCost(behind, weight, problem.prior)
    assert np.isnan(cost.value(problem.unknowns.state(values)))


def test_taking_rows_keeps_their_values(problem: Problem, values: np.ndarray) -> None:
    state = problem.unknowns.state(values)
    rows = np.array([3, 0, 7])
    for name, block in blocks(problem).items():
        if block.rows > 7:
            np.testing.assert_array_equal(
                block.take(rows).value(state), block.value(state)[rows], err_msg=name
            )
