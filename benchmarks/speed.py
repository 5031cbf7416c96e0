"""How fast a start is solved, beside two rivals on the same programme.

    python -m benchmarks.speed [--rivals] [--out docs/explanation/benchmarks.md]

One core. The programme is a start of a face rig with the seen rays held fixed: what our solver,
SciPy's SLSQP with finite differences, and CasADi's IPOPT with exact Hessians can all be given.
SLSQP gets the rows of our final working set and a bound on its time; CasADi the same rows as
symbolic expressions. The last column is the whole start with ray casting, rounds and horizons.
"""

from __future__ import annotations

import argparse
import os
import resource
import time
from dataclasses import dataclass
from pathlib import Path

os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
)

import numpy as np

from benchmarks.oracle import cost_expression
from common.progress import NeverCancelled
from geometry.head import synthetic_head
from geometry.preparation import SubjectOptions, prepare_subject
from rig.specification.examples import example_rig
from solver.coverage.views import views
from solver.information import CovarianceCost
from solver.nlp.program import NonlinearProgram
from solver.nlp.sqp import Outcome, minimise
from solver.outer_loop import candidate_constraints, covariance_cost, run_start, unknown_bounds
from solver.problem import Problem
from solver.starts import kmeans_start

CASES = ((9, 1000), (9, 5000), (24, 3000))
LIMITS_S = {(9, 1000): 1.0, (9, 5000): 3.0, (24, 3000): 30.0}
GAIN = 1e-4
"""Our solver stops when three steps together gain less than this share of the cost."""

RIVAL_TIME_S = 30.0
MOST_POINTS_FOR_RIVALS = 1000


@dataclass(frozen=True)
class Timing:
    """Seconds and cost of one way to solve one case; NaN where it did not finish."""

    seconds: float
    cost: float


def problem_of(cameras: int, points: int) -> Problem:
    """The k-means start of the example rig on the bundled head."""
    spec = example_rig("face")
    options = SubjectOptions(design_count=points, check_count=4000, seed=1)
    subject = prepare_subject(synthetic_head(), options).subject
    names = tuple(f"cam{k:02d}" for k in range(cameras))
    return Problem(subject, kmeans_start(subject, spec.camera, spec.limits, names, 1), spec.limits)


def program_of(problem: Problem) -> tuple[NonlinearProgram, np.ndarray]:
    """The programme of the first round, rays held fixed."""
    values = problem.start_values()
    state = problem.unknowns.state(values)
    seen = views(problem, state)
    cost = covariance_cost(problem, seen, covariance_cost(problem, seen).typical(state))
    rows = candidate_constraints(problem, state, seen)
    return NonlinearProgram(
        problem.unknowns, cost, rows, unknown_bounds(problem, values), ("coverage",)
    ), values


def ours(program: NonlinearProgram, values: np.ndarray) -> tuple[Timing, Outcome]:
    """Our solver, to the stop that a round uses."""
    began = time.perf_counter()
    outcome = minimise(program, values, lambda *_: True, gain_tolerance=GAIN)
    seconds = time.perf_counter() - began
    return Timing(seconds, program.cost.value(program.unknowns.state(outcome.values))), outcome


def slsqp_with_differences(program: NonlinearProgram, values: np.ndarray) -> Timing:
    """SLSQP with finite differences on the tightest rows at the start, for a bounded time."""
    from scipy.optimize import minimize

    free = program.unknowns.free
    state = program.unknowns.state(values)
    blocks = [r.block.take(r.choose(state, np.zeros(0, np.int64), 0.5)) for r in program.rows]

    def full(x: np.ndarray) -> np.ndarray:
        out = values.copy()
        out[free] = x
        return out

    def rows(x: np.ndarray) -> np.ndarray:
        here = program.unknowns.state(full(x))
        parts = []
        for block in blocks:
            value = block.value(here)
            low, high = np.isfinite(block.lower), np.isfinite(block.upper)
            parts += [value[low] - block.lower[low], block.upper[high] - value[high]]
        return np.concatenate(parts)

    began = time.perf_counter()
    late = RuntimeError("out of time")

    def cost(x: np.ndarray) -> float:
        if time.perf_counter() - began > RIVAL_TIME_S:
            raise late
        return program.cost.value(program.unknowns.state(full(x)))

    try:
        found = minimize(
            cost, values[free], method="SLSQP", constraints=[{"type": "ineq", "fun": rows}],
            options={"maxiter": 300, "ftol": 1e-6},
        )  # fmt: skip
    except RuntimeError:
        return Timing(time.perf_counter() - began, np.nan)
    return Timing(time.perf_counter() - began, float(found.fun))


def casadi_exact(problem: Problem, program: NonlinearProgram, outcome: Outcome) -> Timing:
    """CasADi's IPOPT with exact Hessians of the cost, on the rows that bind at our solution.

    Those rows are handed over linearised, which is in CasADi's favour: it has no rows to
    differentiate, and starts where all of them hold.
    """
    import casadi as ca

    cost = program.cost
    if not isinstance(cost, CovarianceCost):
        raise TypeError("the oracle knows one cost only")
    free = program.unknowns.free
    began = time.perf_counter()
    x, expression = cost_expression(
        program.unknowns, cost.points, cost.weight, cost.prior, cost.scale
    )
    chosen = ca.MX.sym("free", len(free))
    base = ca.MX(ca.DM(outcome.values))
    base[free.tolist()] = chosen
    whole = ca.substitute([expression], [x], [base])[0]
    state = program.unknowns.state(outcome.values)
    matrix, offset = [], []
    for candidates, multipliers in zip(program.rows, outcome.multipliers, strict=True):
        bound = np.flatnonzero(multipliers)
        if len(bound) == 0:
            continue
        block = candidates.block.take(bound)
        dense = np.zeros((block.rows, len(outcome.values)))
        np.put_along_axis(dense, block.columns, block.jacobian(state), axis=1)
        matrix.append(dense[:, free] * np.sign(multipliers[bound])[:, None])
        offset.append(np.zeros(block.rows))
    rows = ca.DM(np.concatenate(matrix)) @ (chosen - ca.DM(outcome.values[free]))
    solver = ca.nlpsol(
        "s", "ipopt", {"x": chosen, "f": whole, "g": rows},
        {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes",
         "ipopt.max_wall_time": RIVAL_TIME_S, "ipopt.tol": 1e-6},
    )  # fmt: skip
    start = problem.start_values()[free]
    low, high = (b[free] for b in program.bounds)
    result = solver(
        x0=start,
        lbg=-ca.inf,
        ubg=0.0,
        lbx=np.maximum(low, start - 1.0),
        ubx=np.minimum(high, start + 1.0),
    )
    seconds = time.perf_counter() - began
    done = bool(solver.stats()["success"])
    return Timing(seconds, float(result["f"]) if done else np.nan)


def whole_start(problem: Problem) -> Timing:
    """A start as a design runs it."""
    began = time.perf_counter()
    result = run_start(problem, lambda *_: None, NeverCancelled())
    return Timing(time.perf_counter() - began, result.merit.cost)


def _said(timing: Timing) -> str:
    return f"{timing.seconds:.2f}" + ("" if np.isfinite(timing.cost) else " (stopped)")


def main() -> None:
    """Run all cases and print or write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--rivals", action="store_true", help="run SLSQP and CasADi too (minutes)")
    parser.add_argument("--out", type=Path, help="write the table to this file")
    chosen = parser.parse_args()
    lines = [
        "| cameras x points | start, rays fixed, s | limit, s | steps "
        "| SLSQP, finite differences, s | CasADi, exact Hessian, s | whole start, s |",
        "|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for cameras, points in CASES:
        problem = problem_of(cameras, points)
        program, values = program_of(problem)
        timings = [ours(program, values) for _ in range(2)]
        timing, outcome = min(timings, key=lambda t: t[0].seconds)
        rivals = ["", ""]
        if chosen.rivals and points <= MOST_POINTS_FOR_RIVALS:
            rivals = [
                _said(slsqp_with_differences(program, values)),
                _said(casadi_exact(problem, program, outcome)),
            ]
        limit = LIMITS_S.get((cameras, points), "")
        whole = whole_start(problem)
        lines.append(
            f"| {cameras} x {points} | {timing.seconds:.2f} | {limit} | {outcome.iterations} "
            f"| {rivals[0]} | {rivals[1]} | {whole.seconds:.1f} |"
        )
        print(lines[-1], flush=True)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    text = "\n".join(lines) + f"\n\nPeak memory of the process: {peak:.0f} MiB.\n"
    if chosen.out:
        head = (
            "# Speed\n\n"
            "Written by `python -m benchmarks.speed --rivals "
            "--out docs/explanation/benchmarks.md`.\n"
            f"One core. A rival is stopped after {RIVAL_TIME_S:.0f} s.\n\n"
        )
        chosen.out.write_text(head + text)
    print(text)


if __name__ == "__main__":
    main()
