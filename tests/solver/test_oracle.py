"""The closed-form derivatives of the cost against automatic differentiation of Eqs 5 to 7."""

from __future__ import annotations

import casadi as ca
import numpy as np
import rigs

from benchmarks.oracle import cost_expression
from solver.information import CovarianceCost
from solver.problem import Scene


def test_cost_gradient_and_hessian_agree_with_automatic_differentiation() -> None:
    subject = rigs.face(25, 60)
    scene = Scene(subject, rigs.face_cameras(subject, 4), rigs.face_limits())
    rng = np.random.default_rng(3)
    values = scene.start_values() + 0.03 * rng.normal(size=28)
    weight = scene.ray_weight[:, None] * (rng.random((4, 25)) < 0.8)
    state = scene.unknowns.state(values)
    scale = CovarianceCost(scene.points, weight, scene.prior).typical(state)
    cost = CovarianceCost(scene.points, weight, scene.prior, scale)
    x, expression = cost_expression(scene.unknowns, scene.points, weight, scene.prior, scale)
    hessian, gradient = ca.hessian(expression, x)
    oracle = ca.Function("oracle", [x], [expression, gradient, hessian])
    value, slope, bend = (np.array(v).squeeze() for v in oracle(values))
    # Points seen once only have a condition number of about 1e8, which leaves 8 of 16 digits.
    assert abs(cost.value(state) / value - 1.0) < 1e-8
    np.testing.assert_allclose(cost.gradient(state), slope, atol=1e-8 * np.abs(slope).max())
    np.testing.assert_allclose(cost.hessian(state), bend, atol=1e-7 * np.abs(bend).max())
