"""A problem with its rays frozen, written as a nonlinear program: cost, constraints, bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from solver.constraints.builders.bodies import body_constraints
from solver.constraints.builders.coverage import assigned_view_constraints
from solver.constraints.builders.positions import position_constraints
from solver.constraints.builders.rays import ray_constraints
from solver.constraints.builders.rolls import roll_constraints
from solver.constraints.candidates import CandidateConstraints
from solver.coverage.views import Views, views
from solver.information import CovarianceCost
from solver.problem import Problem
from solver.variables import FOCUS, PER_CAMERA, NetworkState

SATISFIED = 2e-6
"""Rows count as satisfied within this, in the solver's units of order one; refinement makes it
less."""

COVERAGE = ("coverage",)
"""Families of which a row that cannot be had must not excuse the others."""


@dataclass(frozen=True, eq=False)
class Merit:
    """How good a network really is: violation of limits and of coverage first, then the cost."""

    violation: float
    shortfall: float
    cost: float

    @property
    def feasible(self) -> bool:
        """Whether all limits of the design points hold."""
        return self.violation <= SATISFIED and self.shortfall <= 0.0

    def better_than(self, other: Merit | None) -> bool:
        """Feasible beats infeasible; then less violation and shortfall; then less cost."""
        if other is None or self.feasible != other.feasible:
            return other is None or self.feasible
        if self.feasible:
            return self.cost < other.cost
        return (self.violation + self.shortfall, self.cost) < (
            other.violation + other.shortfall,
            other.cost,
        )


def unknown_bounds(problem: Problem, start: Floats) -> tuple[Floats, Floats]:
    """Bounds (7 n,) of all unknowns: Eq 8 about ``start``, and the focus range."""
    low, high = np.full(len(start), -np.inf), np.full(len(start), np.inf)
    box, scale = problem.limits.bounds, problem.length_mm
    if box is not None:
        half = [
            np.inf if v is None else np.radians(v)
            for v in (box.omega_deg, box.phi_deg, box.kappa_deg)
        ]
        half += [np.inf if v is None else v / scale for v in (box.x_mm, box.y_mm, box.z_mm)]
        half.append(np.inf)
        low, high = start - np.tile(half, problem.count), start + np.tile(half, problem.count)
    for k, camera in enumerate(problem.cameras):
        at = PER_CAMERA * k + FOCUS
        low[at] = camera.camera.min_focus_distance_mm / scale
        high[at] = np.inf
    return low, high


def covariance_cost(problem: Problem, seen: Views, scale: float = 1.0) -> CovarianceCost:
    """The cost with the rays that are seen now."""
    weight = seen.seen * problem.ray_weight[:, None]
    return CovarianceCost(problem.points, weight, problem.prior, scale)


def cost_scale(problem: Problem, values: Floats) -> float:
    """The cost's unit for a solve from the unknowns (7 n,): the median of the points' norms."""
    state = problem.unknowns.state(values)
    return covariance_cost(problem, views(problem, state)).typical(state)


def candidate_constraints(
    problem: Problem, state: NetworkState, seen: Views
) -> list[CandidateConstraints]:
    """Every row that the limits ask for at this state."""
    return (
        ray_constraints(problem, seen.framed)
        + assigned_view_constraints(problem, seen.assigned, seen.margin_deg)
        + roll_constraints(problem, state)
        + position_constraints(problem, state)
        + body_constraints(problem, state)
    )


def merit(
    problem: Problem,
    values: Floats,
    seen: Views,
    rows: list[CandidateConstraints],
    bounds: tuple[Floats, Floats],
    shortfall: float,
) -> Merit:
    """The true merit of a network whose rays are ``seen`` and whose rows are ``rows``."""
    state = problem.unknowns.state(values)
    watched = [
        r.block.violation(state).max(initial=0.0) for r in rows if r.block.family not in COVERAGE
    ]
    free = problem.unknowns.free
    out = np.maximum(bounds[0] - values, values - bounds[1])[free].max(initial=0.0)
    cost = covariance_cost(problem, seen).value(state)
    return Merit(float(max([out, 0.0, *watched])), shortfall, cost)
