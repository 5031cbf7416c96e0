"""Other solvers for the same programme: second opinions for tests, rivals for benchmarks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from geometry.arrays import Floats
from solver.nlp.working_program import WorkingProgram

Watch = Callable[[int, float, float], bool]
"""Called with iteration, objective and violation; returns False to stop."""

IPOPT_OPTIONS: dict[str, int | float | str] = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-7,
    "constr_viol_tol": 1e-9,
    "acceptable_tol": 1e-5,
    "acceptable_constr_viol_tol": 1e-8,
    "acceptable_iter": 8,
    "max_iter": 300,
    # By default IPOPT widens all bounds by 1e-8 before it starts; limits are meant as given.
    "bound_relax_factor": 0.0,
    "mu_strategy": "adaptive",
}

_WORDS = {
    0: "the optimality conditions hold to the tolerance",
    1: "the optimality conditions hold to the looser, acceptable tolerance",
    2: "the rows could not be satisfied near here",
    3: "the search direction became too small",
    4: "the iterates diverged",
    5: "stopped by request",
    6: "a feasible network was found",
    -1: "the limit of iterations was reached",
    -2: "the restoration of feasibility failed",
    -3: "the step could not be computed",
    -4: "the limit of time was reached",
    -10: "there are more equalities than unknowns",
    -13: "the cost or a row is not a number at the start",
}


@dataclass(frozen=True, eq=False)
class Outcome:
    """Where a solver ended: variables, ``L = f + multipliers . g`` and why."""

    variables: Floats
    multipliers: Floats
    kkt_error: float
    iterations: int
    success: bool
    stopped: bool
    why: str


def solve_ipopt(
    working: WorkingProgram,
    start: Floats,
    watch: Watch,
    options: dict[str, int | float | str] | None = None,
) -> Outcome:
    """Interior point with exact second derivatives (COIN-OR IPOPT, MUMPS inside)."""
    import ipyopt

    low, high = working.bounds
    row_low, row_high = working.row_bounds
    reached = {"iterations": 0, "stopped": False}

    def into(function: Callable[..., Floats]) -> Callable[..., None]:
        def call(x: Floats, *args: Any) -> None:
            args[-1][()] = function(x, *args[:-1])

        return call

    def intermediate(mode: int, iteration: int, cost: float, violation: float, *_: float) -> bool:
        del mode
        reached["iterations"] = iteration
        go_on = watch(iteration, cost, violation)
        reached["stopped"] = not go_on
        return go_on

    problem = ipyopt.Problem(
        n=working.size,
        x_l=_wide(low),
        x_u=_wide(high),
        m=working.rows,
        g_l=_wide(row_low),
        g_u=_wide(row_high),
        sparsity_indices_jac_g=working.jacobian_pattern,
        sparsity_indices_h=working.hessian_pattern,
        eval_f=working.objective,
        eval_grad_f=into(working.gradient),
        eval_g=into(working.values),
        eval_jac_g=into(working.jacobian),
        eval_h=into(working.hessian),
        intermediate_callback=intermediate,
        ipopt_options=IPOPT_OPTIONS | (options or {}),
    )
    multipliers, below, above = (
        np.zeros(working.rows),
        np.zeros(working.size),
        np.zeros(working.size),
    )
    inside = np.clip(start, low, high)
    x, _, status = problem.solve(inside, mult_g=multipliers, mult_x_L=below, mult_x_U=above)
    x = np.asarray(x)
    kkt = kkt_error(working, x, multipliers, above - below)
    why = _WORDS.get(status, f"IPOPT ended with status {status}")
    stopped = bool(reached["stopped"])
    return Outcome(
        x,
        multipliers,
        kkt,
        int(reached["iterations"]),
        status in (0, 1),
        stopped,
        why,
    )


def _wide(bounds: Floats) -> Floats:
    """Bounds with infinity as IPOPT knows it."""
    return np.clip(bounds, -1e20, 1e20)


class _Stopped(Exception):  # noqa: N818 - a signal, not an error
    """Raised out of SciPy's callback to end a run."""


def solve_slsqp(
    working: WorkingProgram, start: Floats, watch: Watch, max_iterations: int = 500
) -> Outcome:
    """Sequential least squares programming with exact first derivatives (SciPy)."""
    from scipy.optimize import Bounds, minimize

    low, high = working.row_bounds
    equal = low == high
    sides = [(np.flatnonzero(equal), low, 1.0)]
    sides += [(np.flatnonzero(~equal & np.isfinite(low)), low, 1.0)]
    sides += [(np.flatnonzero(~equal & np.isfinite(high)), high, -1.0)]
    row, column = working.jacobian_pattern

    def dense(x: Floats) -> Floats:
        out = np.zeros((working.rows, working.size))
        np.add.at(out, (row, column), working.jacobian(x))
        return out

    constraints = [
        {
            "type": "eq" if k == 0 else "ineq",
            "fun": lambda x, r=rows, b=bound_, s=sign: s * (working.values(x)[r] - b[r]),
            "jac": lambda x, r=rows, s=sign: s * dense(x)[r],
        }
        for k, (rows, bound_, sign) in enumerate(sides)
        if len(rows)
    ]
    latest = {"x": np.clip(start, *working.bounds), "iterations": 0}

    def callback(x: Floats) -> None:
        latest["x"] = np.array(x)
        latest["iterations"] += 1
        if not watch(int(latest["iterations"]), working.objective(x), violation(working, x)):
            raise _Stopped

    try:
        result = minimize(
            working.objective,
            latest["x"],
            jac=working.gradient,
            method="SLSQP",
            callback=callback,
            bounds=Bounds(*working.bounds),
            constraints=constraints,
            options={"maxiter": max_iterations, "ftol": 1e-12},
        )
    except _Stopped:
        return Outcome(
            latest["x"], np.zeros(0), np.nan, int(latest["iterations"]), False, True, _WORDS[5]
        )
    why = str(result.message).rstrip(".").lower()
    return Outcome(result.x, np.zeros(0), np.nan, int(result.nit), bool(result.success), False, why)


def violation(working: WorkingProgram, variables: Floats) -> float:
    """Largest breach of any row or bound."""
    values = working.values(variables)
    low, high = working.row_bounds
    rows = np.maximum(low - values, values - high).max(initial=0.0)
    x_low, x_high = working.bounds
    return float(max(rows, np.maximum(x_low - variables, variables - x_high).max(initial=0.0), 0.0))


def kkt_error(
    working: WorkingProgram, variables: Floats, multipliers: Floats, bound_multipliers: Floats
) -> float:
    """Largest entry of the gradient of ``f + multipliers . rows + bound_multipliers . x``."""
    residual = working.gradient(variables) + bound_multipliers
    row, column = working.jacobian_pattern
    np.add.at(residual, column, working.jacobian(variables) * multipliers[row])
    return float(np.abs(residual).max(initial=0.0))
