"""From a network chosen well to the optimum near it: short moves, each of which has to help.

The outer loop of :mod:`solver.outer_loop` lets cameras go where the frozen rays say; from a good
network that leads away from it, because rays that go lost have to be won back. Here an outer
iteration stays within a box about the best network so far, and holds every view that it has
(:mod:`solver.short_move`). It is taken when the network it finds is better on the check points,
with the rays that it really has, and the box grows; otherwise the box shrinks, and the points by
which it was worse are named. What was held on to is held on to in the next moves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from common.progress import CancelToken
from geometry.arrays import Floats, Ints
from solver.coverage.views import (
    NEAR,
    NOWHERE,
    Judged,
    Views,
    centres_mm,
    in_frame,
    judge,
    views,
)
from solver.coverage.visibility import cast_rays
from solver.formulation import Merit, candidate_constraints, cost_scale, merit, unknown_bounds
from solver.information import CovarianceCost, loss_by_one_view
from solver.nlp.sqp import Outcome
from solver.outer_loop import Monitor, StartResult
from solver.problem import Problem
from solver.short_move import MARGINS, Effort, Held, short_move
from solver.workers import Report

FIRST_BOX = 0.1
"""Half the box of the first move, in length scales and radians: about 6 degrees."""

LARGEST_BOX = 0.3
SMALLEST_BOX = 0.004
_MOST_WEAK = 50
_MOST_WORSENED = 30
"""Points that are held on to, so few that they hardly weigh among the design points."""

MAX_MOVES = 12
_STEPS, _TOLERANCE, _GAIN = 25, 1e-4, 1e-5
_SETTLED = 5e-3
"""Relative gain below which moves end: the last one, of the best network, gains the rest."""

_VIOLATION, _SHORTFALL = 300.0, 3000.0
"""Weights of a violation (in length scales) and of a share of points, in units of the cost: well
above the multipliers of limits that bind, which are of order ten."""

_BROKEN, _MET = 0.05, 1e-7
"""A network that breaks a limit at all is charged the first; limits count as met within the second.
"""


@dataclass(frozen=True, eq=False)
class _Network:
    """A network with the rays that it really has.

    The cost of ``merit`` is that of the check points, the mean of their norms ``each`` (q,);
    ``weak`` are those of them that losing one view would hurt most.
    """

    values: Floats
    seen: Views
    merit: Merit
    judged: Judged
    each: Floats
    weak: Ints


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
    seen = views(problem, state, None, MARGINS, NOWHERE)
    rows = candidate_constraints(problem, state, seen)
    judged = judge(problem, state)
    found = merit(problem, values, seen, rows, bounds, judged.shortfall)
    each, weak = _checked(problem, values)
    return _Network(values, seen, replace(found, cost=float(each.mean())), judged, each, weak)


def _checked(problem: Problem, values: Floats) -> tuple[Floats, Ints]:
    """Norms (q,) of the check points, and which of them one lost view would hurt most."""
    source, state = problem.subject.check_points, problem.unknowns.state(values)
    limit = problem.limits.incidence.ray_max_deg
    positions = problem.visibility_positions[:1]
    eyes = centres_mm(problem, state)
    seen = cast_rays(source, problem.subject.occluder, eyes, limit, positions).seen
    for i, camera in enumerate(problem.placed(values)):
        seen[i] &= in_frame(camera, source.points_mm)
    weight, points = seen * problem.ray_weight[:, None], problem.scaled(source.points_mm)
    each = CovarianceCost(points, weight, problem.prior).norms(state)
    loss = loss_by_one_view(state, points, weight, problem.prior)
    weak = np.sort(np.argsort(-loss, kind="stable")[:_MOST_WEAK])
    return each, weak[loss[weak] > 0.0]


def _worsened(before: _Network, after: _Network) -> Ints:
    """Check points (k,) that a move lost, or worsened most."""
    grown = after.each - before.each
    worst = np.argsort(-grown, kind="stable")[:_MOST_WORSENED]
    return np.union1d(after.judged.missed, worst[grown[worst] > 0.0])


def run_near(problem: Problem, report: Report, cancel: CancelToken) -> StartResult:
    """Optimise from the problem's own cameras by short moves; never worse than they are."""
    start = problem.start_values()
    bounds = unknown_bounds(problem, problem.anchor_values())
    monitor = Monitor(report, cancel)
    scale = cost_scale(problem, start)
    best = _looked_at(problem, start, bounds)
    held = Held.of(best.seen.framed)
    outcome = Outcome(start, [], np.inf, best.merit.violation, 0, False, False, "")
    half, why = FIRST_BOX, f"the limit of {MAX_MOVES} moves was reached"
    for _ in range(MAX_MOVES):
        monitor.outer_iterations += 1
        held, effort = held.naming(best.weak), Effort(half, _TOLERANCE, _GAIN, _STEPS)
        whole = best.judged.shortfall <= 0.0
        moved = short_move(problem, best.values, held, effort, bounds, scale, monitor.watch, whole)
        monitor.steps += moved.outcome.iterations
        if moved.outcome.stopped:
            outcome, why = moved.outcome, moved.outcome.why
            break
        found = _looked_at(problem, moved.outcome.values, bounds)
        if _better(found.merit, best.merit, scale):
            small = found.merit.cost > best.merit.cost * (1.0 - _SETTLED)
            settled = best.merit.feasible and small and moved.clean and not moved.edge
            best, outcome, half = found, moved.outcome, min(2.0 * half, LARGEST_BOX)
            held = moved.held.seeing(found.seen.framed)
            if settled:
                why = f"another move gained less than {_SETTLED:g} of the cost"
                break
        else:
            held = moved.held.naming(_worsened(best, found))
            half = 0.4 * min(half, moved.size)
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
        held.naming(best.weak).named,
        MARGINS,
        NEAR,
        held.naming(best.weak),
    )
