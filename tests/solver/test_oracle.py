"""The closed-form derivatives of the cost against automatic differentiation of Eqs 5 to 7."""

from __future__ import annotations

import casadi as ca
import numpy as np
import rigs

from benchmarks.oracle import cost_expression
from solver.information import CovarianceCost
from solver.problem import Problem


def test_cost_gradient_and_hessian_agree_with_automatic_differentiation() -> None:
    subject = rigs.face(25, 60)
    problem = Problem(subject, rigs.face_cameras(subject, 4), rigs.face_limits())
    rng = np.random.default_rng(3)
    values = problem.start_values() + 0.03 * rng.normal(size=28)
    weight = problem.ray_weight[:, None] * (rng.random((4, 25)) < 0.8)
    state = problem.unknowns.state(values)
    scale = CovarianceCost(problem.points, weight, problem.prior).typical(state)
    cost = CovarianceCost(problem.points, weight, problem.prior, scale)
    x, expression = cost_expression(problem.unknowns, problem.points, weight, problem.prior, scale)
    hessian, gradient = ca.hessian(expression, x)
    oracle = ca.Function("oracle", [x], [expression, gradient, hessian])
    value, slope, bend = (np.array(v).squeeze() for v in oracle(values))
    # Points seen once only have a condition number of about 1e8, which leaves 8 of 16 digits.
    assert abs(cost.value(state) / value - 1.0) < 1e-8
    np.testing.assert_allclose(cost.gradient(state), slope, atol=1e-8 * np.abs(slope).max())
    np.testing.assert_allclose(cost.hessian(state), bend, atol=1e-7 * np.abs(bend).max())
