"""From a network chosen well to the optimum near it: short moves, each of which has to help.

The outer loop of :mod:`solver.outer_loop` lets cameras go where the frozen rays say; from a good
network that leads away from it, because rays that go lost have to be won back. Here an outer
iteration stays within a box about the best network so far. It is taken when the network it finds
is better with the rays that it really has, and the box grows; otherwise the box shrinks, and what
went wrong - a point hidden, out of frame, or no longer seen often enough - is held on to, and so
is every view until a move helps again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from common.progress import CancelToken
from geometry.arrays import Bools, Floats, Ints
from solver.constraints.builders.coverage import cut_constraints
from solver.coverage.assignment import Margins
from solver.coverage.cuts import VisibilityCuts, cuts_for_hidden, opening_directions
from solver.coverage.views import (
    FEW_VIEWS,
    NEAR,
    NOWHERE,
    Judged,
    Views,
    centres_mm,
    holding_scarce,
    in_frame,
    judge,
    views,
    with_points,
)
from solver.coverage.visibility import cast_rays
from solver.formulation import (
    COVERAGE,
    SATISFIED,
    Merit,
    candidate_constraints,
    cost_scale,
    covariance_cost,
    merit,
    unknown_bounds,
)
from solver.information import CovarianceCost, loss_by_one_view
from solver.nlp.program import NonlinearProgram
from solver.nlp.sqp import Outcome, minimise
from solver.outer_loop import Monitor, StartResult
from solver.problem import Problem
from solver.variables import FOCUS, PER_CAMERA
from solver.workers import Report

FIRST_BOX = 0.06
"""Half the box of the first move, in length scales and radians: about 3 degrees."""

LARGEST_BOX = 0.2
SMALLEST_BOX = 0.004
_MOST_WEAK = 50
"""Points that are held on to, so few that they hardly weigh among the design points."""

MAX_MOVES = 24
_STEPS, _LAST_STEPS = 25, 8
_GAIN, _LAST_GAIN = 3e-4, 1e-5
_SETTLED = 1e-3
_MARGINS = Margins(0.01, 0.0)
_VIOLATION, _SHORTFALL = 300.0, 3000.0
"""Weights of a violation (in length scales) and of a share of points, in units of the cost: well
above the multipliers of limits that bind, which are of order ten."""

_BROKEN, _MET, _NEARLY_MET = 0.05, 1e-7, 1e-3
"""A network that breaks a limit at all is charged the first; limits count as met within the second,
and as all but met within the third."""


@dataclass(frozen=True, eq=False)
class _Network:
    """A network with the rays that it really has.

    The cost of ``merit`` is that of the check points; ``weak`` are those of them that losing one
    view would hurt most.
    """

    values: Floats
    seen: Views
    merit: Merit
    judged: Judged
    weak: Ints


@dataclass(frozen=True, eq=False)
class _Held:
    """What earlier moves went wrong by: framed points (n, q), check points to add, cuts.

    A point with no more than ``views`` of them keeps each.
    """

    framed: Bools
    added_points: Ints
    cuts: VisibilityCuts
    views: int = FEW_VIEWS


def _better(one: Merit, other: Merit, scale: float) -> bool:
    """Whether a move helped: by cost, where violations weigh more than they could gain."""

    def total(found: Merit) -> float:
        broken = _BROKEN if found.violation > _MET or found.shortfall > 0.0 else 0.0
        weighed = _VIOLATION * found.violation + _SHORTFALL * found.shortfall
        return found.cost / scale + broken + weighed

    return total(one) < total(other)


def _looked_at(problem: Problem, values: Floats, bounds: tuple[Floats, Floats]) -> _Network:
    """Cast the rays of a network and judge it."""
    state = problem.unknowns.state(values)
    seen = views(problem, state, None, _MARGINS, NOWHERE)
    rows = candidate_constraints(problem, state, seen)
    judged = judge(problem, state)
    found = merit(problem, values, seen, rows, bounds, judged.shortfall)
    cost, weak = _checked(problem, values)
    return _Network(values, seen, replace(found, cost=cost), judged, weak)


def _checked(problem: Problem, values: Floats) -> tuple[float, Ints]:
    """The cost on the check points, and which of them one lost view would hurt most."""
    source, state = problem.subject.check_points, problem.unknowns.state(values)
    limit = problem.limits.incidence.ray_max_deg
    positions = problem.visibility_positions[:1]
    eyes = centres_mm(problem, state)
    seen = cast_rays(source, problem.subject.occluder, eyes, limit, positions).seen
    for i, camera in enumerate(problem.placed(values)):
        seen[i] &= in_frame(camera, source.points_mm)
    weight, points = seen * problem.ray_weight[:, None], problem.scaled(source.points_mm)
    cost = CovarianceCost(points, weight, problem.prior).value(state)
    loss = loss_by_one_view(state, points, weight, problem.prior)
    weak = np.sort(np.argsort(-loss, kind="stable")[:_MOST_WEAK])
    return cost, weak[loss[weak] > 0.0]


def _box(values: Floats, half: float, bounds: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Bounds (7 n,) of one move; the focus is free."""
    reach = np.full(len(values), half)
    reach[FOCUS::PER_CAMERA] = np.inf
    return np.maximum(bounds[0], values - reach), np.minimum(bounds[1], values + reach)


def _moved(
    problem: Problem,
    best: _Network,
    held: _Held,
    half: float,
    bounds: tuple[Floats, Floats],
    scale: float,
    monitor: Monitor,
) -> tuple[Outcome, VisibilityCuts]:
    """Solve within a box about the best network; also the cuts of rays that go lost there."""
    problem = with_points(problem, np.union1d(held.added_points, best.weak))
    state = problem.unknowns.state(best.values)
    seen = views(problem, state, None, _MARGINS, NEAR)
    seen = holding_scarce(problem, seen, held.views)
    seen = replace(seen, framed=seen.framed | held.framed)
    rows = candidate_constraints(problem, state, seen)
    rows += cut_constraints(problem, held.cuts.of(seen.assigned))
    program = NonlinearProgram(
        problem.unknowns,
        covariance_cost(problem, seen, scale),
        rows,
        _box(best.values, half, bounds),
        COVERAGE,
    )
    outcome = minimise(
        program,
        best.values,
        monitor.watch,
        gain_tolerance=_GAIN,
        radius=half,
        max_iterations=_STEPS,
    )
    if _MET < outcome.violation < _NEARLY_MET:
        # Limits that are all but met are worth a few steps more: a move that breaks one is lost.
        outcome = minimise(
            program,
            outcome.values,
            monitor.watch,
            gain_tolerance=_LAST_GAIN,
            known=outcome.multipliers,
            radius=0.1 * half,
            max_iterations=_LAST_STEPS,
        )
    monitor.steps += outcome.iterations
    opening = opening_directions(problem, state, seen.assigned)
    after = problem.unknowns.state(outcome.values)
    return outcome, cuts_for_hidden(problem, after, seen.assigned, opening)


def run_near(problem: Problem, report: Report, cancel: CancelToken) -> StartResult:
    """Optimise from the problem's own cameras by short moves; never worse than they are."""
    start = problem.start_values()
    bounds = unknown_bounds(problem, problem.anchor_values())
    monitor = Monitor(report, cancel)
    scale = cost_scale(problem, start)
    best = _looked_at(problem, start, bounds)
    held = _Held(best.seen.framed, np.zeros(0, np.int64), VisibilityCuts.none())
    outcome = Outcome(start, [], np.inf, best.merit.violation, 0, False, False, "")
    half, why = FIRST_BOX, f"the limit of {MAX_MOVES} moves was reached"
    for _ in range(MAX_MOVES):
        monitor.outer_iterations += 1
        trial, lost = _moved(problem, best, held, half, bounds, scale, monitor)
        found = _looked_at(problem, trial.values, bounds)
        if trial.stopped:
            outcome, why = trial, trial.why
            break
        if _better(found.merit, best.merit, scale):
            settled = best.merit.feasible and (
                found.merit.cost > best.merit.cost * (1.0 - _SETTLED)
            )
            best, outcome, half = found, trial, min(1.5 * half, LARGEST_BOX)
            held = replace(
                held, framed=found.seen.framed, cuts=VisibilityCuts.none(), views=FEW_VIEWS
            )
            if settled:
                why = f"another move gained less than {_SETTLED:g} of the cost"
                break
        else:
            # What a longer move brings into view may be more than a shorter one can keep sharp.
            hopeless = trial.violation > SATISFIED
            held = _Held(
                best.seen.framed if hopeless else held.framed | found.seen.framed,
                np.union1d(held.added_points, found.judged.missed),
                held.cuts.joined(lost),
                problem.count,
            )
            half *= 0.4
            if half < SMALLEST_BOX:
                why = "no move in reach improves the network any further"
                break
    return StartResult(
        best.values,
        best.merit,
        outcome,
        monitor.steps,
        monitor.outer_iterations,
        outcome.stopped,
        why,
        np.union1d(held.added_points, best.weak),
        _MARGINS,
        NEAR,
    )
