"""The cost of Eq 7 written in CasADi from the collinearity equations (Eq 5), differentiated there.

Shares no formula with :mod:`solver.information`: the partials of Eq 6 come from automatic
differentiation of the projections, and the rotation is multiplied out symbolically.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from geometry.arrays import Floats
from solver.variables import PER_CAMERA, Unknowns


def rotation(angles: Any, base: Floats) -> Any:
    """``M = Mk(kappa) Mp(phi) Mw(omega) M0`` as a symbolic 3 x 3 matrix."""
    w, p, k = angles[0], angles[1], angles[2]
    one, zero = 1, 0
    mw = ca.blockcat(
        [[one, zero, zero], [zero, ca.cos(w), ca.sin(w)], [zero, -ca.sin(w), ca.cos(w)]]
    )
    mp = ca.blockcat(
        [[ca.cos(p), zero, -ca.sin(p)], [zero, one, zero], [ca.sin(p), zero, ca.cos(p)]]
    )
    mk = ca.blockcat(
        [[ca.cos(k), ca.sin(k), zero], [-ca.sin(k), ca.cos(k), zero], [zero, zero, one]]
    )
    return mk @ mp @ mw @ ca.DM(base)


def image_point(pose: Any, base: Floats, point: Any) -> Any:
    """Eq 5: x and y of a point for unit focal length; ``pose``: three angles, three coordinates."""
    local = rotation(pose[0:3], base) @ (point - pose[3:6])
    return ca.vertcat(-local[0] / local[2], -local[1] / local[2])


def point_cost(unknowns: Unknowns, prior: float) -> Any:
    """Function of all unknowns, one point (3,) and its weights (n,): the norm of Q."""
    x = ca.MX.sym("x", PER_CAMERA * unknowns.count)
    point, weight = ca.MX.sym("point", 3), ca.MX.sym("weight", unknowns.count)
    normal = prior * ca.MX.eye(3)
    for i in range(unknowns.count):
        pose = x[PER_CAMERA * i : PER_CAMERA * i + 6]
        partials = ca.jacobian(image_point(pose, unknowns.base[i], point), point)
        normal = normal + weight[i] * partials.T @ partials
    q = ca.inv(normal)
    return ca.Function("norm_q", [x, point, weight], [ca.sqrt(ca.sumsqr(q))])


def cost_expression(
    unknowns: Unknowns, points: Floats, weight: Floats, prior: float, scale: float
) -> tuple[Any, Any]:
    """The unknowns as a symbol and the mean cost as an expression of it."""
    x = ca.MX.sym("x", PER_CAMERA * unknowns.count)
    each = point_cost(unknowns, prior).map(len(points))
    total = ca.sum2(each(ca.repmat(x, 1, len(points)), ca.DM(points.T), ca.DM(np.array(weight))))
    return x, total / (len(points) * scale)
