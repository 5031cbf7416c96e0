"""From one start to one network: solve, look again, until nothing changes.

An outer iteration freezes which rays are seen and which views are assigned, and solves a smooth
program. Then the rays are cast anew. An iteration counts only when the network it found is
better with the rays it really has, so a point cannot be lost unnoticed. The first iterations
work on a thinned set of points; the last ones on all.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from common.progress import CancelToken
from geometry.arrays import Floats, Ints
from solver.constraints.builders.coverage import cut_constraints
from solver.constraints.candidates import CandidateConstraints
from solver.coverage.assignment import Margins
from solver.coverage.cuts import VisibilityCuts, cuts_for_hidden, opening_directions
from solver.coverage.views import (
    FAR,
    FIRST_MARGINS,
    Judged,
    Reach,
    Views,
    judge,
    views,
    with_points,
)
from solver.formulation import (
    COVERAGE,
    Merit,
    candidate_constraints,
    cost_scale,
    covariance_cost,
    merit,
    unknown_bounds,
)
from solver.nlp.program import NonlinearProgram
from solver.nlp.sqp import FIRST_RADIUS, Outcome, minimise
from solver.problem import Problem
from solver.short_move import Held
from solver.workers import Report

MAX_OUTER_ITERATIONS = 12
MAX_CUT_PASSES = 4
MAX_STEPS = 40
MAX_COVERAGE_PENALTY = 1e3

SETTLED = 1e-3
"""Relative gain below which another outer iteration is not worth its time."""

THINNED_POINTS = 250
"""Points of the first iterations: enough for the shape of the network, quick to solve."""


@dataclass(frozen=True, eq=False)
class StartResult:
    """What came of one start: unknowns (7 n,), merit and how it went.

    ``added_points`` are check points that had to be named for more views, ``margins`` what was
    assigned beyond the limits, ``reach`` how far cameras were expected to move: whoever goes on
    from here has to ask for the same. ``held`` is what a network that was moved shortly held on to.
    """

    values: Floats
    merit: Merit
    outcome: Outcome
    iterations: int
    rounds: int
    stopped: bool
    why: str
    added_points: Ints
    margins: Margins
    reach: Reach = FAR
    held: Held | None = None

    def naming(self, points: Ints, shortfall: float) -> StartResult:
        """With check points named that fell short by a share, or were worsened."""
        return replace(
            self,
            added_points=np.union1d(self.added_points, points),
            margins=self.margins.wider(shortfall),
            held=None if self.held is None else self.held.naming(points),
        )


class Monitor:
    """Counts what was done so far, passes it on, and says whether to go on."""

    def __init__(self, report: Report, cancel: CancelToken) -> None:
        self._report, self._cancel = report, cancel
        self.steps = 0
        self.outer_iterations = 0

    def watch(self, iteration: int, cost: float, violation: float) -> bool:
        """Pass on one step of a solve; False when it is to stop."""
        self._report(self.outer_iterations, self.steps + iteration, cost, violation)
        return not self._cancel.is_set()


@dataclass(frozen=True, eq=False)
class _Level:
    """How one set of points (thinned or all) is worked on.

    ``gain`` below which a solve ends, relative to the cost; ``tolerated`` shortfall of coverage;
    ``may_add``: whether missed check points join the design points.
    """

    bounds: tuple[Floats, Floats]
    cost_scale: float
    gain: float
    tolerated: float = 0.0
    may_add: bool = True


@dataclass(frozen=True, eq=False)
class _Demands:
    """What is asked of coverage beyond the limits; it grows while the judged coverage falls short.

    ``penalty`` of a lost view, ``margins``, ``added_points`` among the check points.
    """

    penalty: float = 10.0
    margins: Margins = FIRST_MARGINS
    added_points: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def after(self, judged: Judged, shortfall: float, may_add: bool) -> _Demands:
        """The demands after coverage was judged, and fell short by more than is tolerated."""
        if shortfall <= 0.0:
            return self
        return _Demands(
            min(2.0 * self.penalty, MAX_COVERAGE_PENALTY),
            self.margins.wider(shortfall),
            np.union1d(self.added_points, judged.missed) if may_add else self.added_points,
        )


@dataclass(frozen=True, eq=False)
class _Frozen:
    """A problem with its rays frozen: what is seen, the constraints, the cuts known so far."""

    problem: Problem
    seen: Views
    rows: list[CandidateConstraints]

    @classmethod
    def at(
        cls,
        problem: Problem,
        values: Floats,
        earlier: Views | None,
        margins: Margins,
    ) -> _Frozen:
        """Cast the rays at the unknowns (7 n,)."""
        state = problem.unknowns.state(values)
        seen = views(problem, state, earlier, margins)
        return cls(problem, seen, candidate_constraints(problem, state, seen))


@dataclass(frozen=True, eq=False)
class _LevelResult:
    """The best network of one level, and what the next level needs to know."""

    values: Floats
    merit: Merit
    outcome: Outcome
    why: str
    seen: Views
    demands: _Demands


def _solve_frozen(
    frozen: _Frozen,
    values: Floats,
    cuts: VisibilityCuts,
    penalty: float,
    level: _Level,
    radius: float,
    monitor: Monitor,
) -> tuple[Outcome, VisibilityCuts]:
    """Solve with the rays frozen; add a visibility cut for each assigned view that gets hidden."""
    problem, assigned = frozen.problem, frozen.seen.assigned
    state = problem.unknowns.state(values)
    opening = opening_directions(problem, state, assigned)
    cuts = cuts.of(assigned).joined(cuts_for_hidden(problem, state, assigned, opening))
    cost = covariance_cost(problem, frozen.seen, level.cost_scale)
    known = None
    for attempt in range(MAX_CUT_PASSES):
        rows = frozen.rows + cut_constraints(problem, cuts)
        program = NonlinearProgram(problem.unknowns, cost, rows, level.bounds, COVERAGE, penalty)
        # What a visibility cut will change anyway need not be computed to the last digit first.
        patience = max(level.gain, 1e-3) if attempt == 0 else level.gain
        outcome = minimise(
            program,
            values,
            monitor.watch,
            gain_tolerance=patience,
            radius=radius,
            known=known,
            max_iterations=MAX_STEPS,
        )
        monitor.steps += outcome.iterations
        values, known, radius = outcome.values, outcome.multipliers, 0.25 * FIRST_RADIUS
        lost = cuts_for_hidden(problem, problem.unknowns.state(values), assigned, opening)
        cuts = cuts.joined(lost)
        if outcome.stopped or (len(lost.camera) == 0 and patience == level.gain):
            break
    return outcome, cuts


def _run_level(
    problem: Problem,
    level: _Level,
    values: Floats,
    radius: float,
    earlier: Views | None,
    monitor: Monitor,
) -> _LevelResult:
    """Outer iterations on one set of points until they settle; the best network of them all."""
    demands, cuts = _Demands(), VisibilityCuts.none()
    frozen = _Frozen.at(problem, values, earlier, demands.margins)
    best = _untouched(frozen, values, level)
    before: Merit | None = None
    why = f"the limit of {MAX_OUTER_ITERATIONS} outer iterations was reached"
    for _ in range(MAX_OUTER_ITERATIONS):
        monitor.outer_iterations += 1
        outcome, cuts = _solve_frozen(frozen, values, cuts, demands.penalty, level, radius, monitor)
        judged = judge(frozen.problem, frozen.problem.unknowns.state(outcome.values))
        shortfall = max(0.0, judged.shortfall - level.tolerated)
        demands = demands.after(judged, shortfall, level.may_add)
        problem = frozen.problem
        if shortfall > 0.0 and level.may_add:
            problem = with_points(problem, judged.missed)
        frozen = _Frozen.at(problem, outcome.values, frozen.seen, demands.margins)
        now = merit(problem, outcome.values, frozen.seen, frozen.rows, level.bounds, shortfall)
        if now.better_than(None if best is None else best[1]):
            best = (outcome.values, now, outcome)
        if outcome.stopped:
            why = outcome.why
            break
        if before is not None and not _worth_another(before, now):
            why = f"another outer iteration gained less than {SETTLED:g} of the cost"
            break
        before = best[1] if best is not None else now
        values, radius = outcome.values, 0.3 * FIRST_RADIUS
    assert best is not None  # noqa: S101 - the loop runs at least once
    return _LevelResult(*best, why, frozen.seen, demands)


def _untouched(
    frozen: _Frozen, values: Floats, level: _Level
) -> tuple[Floats, Merit, Outcome] | None:
    """The start itself where it meets the limits: nothing worse than it is returned."""
    problem = frozen.problem
    judged = judge(problem, problem.unknowns.state(values))
    shortfall = max(0.0, judged.shortfall - level.tolerated)
    now = merit(problem, values, frozen.seen, frozen.rows, level.bounds, shortfall)
    if not now.feasible:
        return None
    why = "no outer iteration found anything better than the start"
    return values, now, Outcome(values, [], np.inf, now.violation, 0, False, False, why)


def _worth_another(before: Merit, now: Merit) -> bool:
    # While a limit is violated, or was until now, iterations still bring points into the frame.
    if not now.feasible or not before.feasible:
        return True
    return now.cost < before.cost * (1.0 - SETTLED)


def thinned(problem: Problem, seed: int) -> tuple[Problem, Ints] | None:
    """The same problem with a random choice of its design points, and which; None if it has few."""
    count = len(problem.subject.design_points)
    if count <= 2 * THINNED_POINTS:
        return None
    chosen = np.sort(np.random.default_rng(seed).choice(count, THINNED_POINTS, replace=False))
    points = problem.subject.design_points.subset(chosen)
    return replace(
        problem, subject=replace(problem.subject, design_points=points), origin=problem.origin_mm
    ), chosen


def run_start(problem: Problem, report: Report, cancel: CancelToken, seed: int = 0) -> StartResult:
    """Optimise from the problem's own cameras as the start, which may be far from any optimum."""
    values = problem.start_values()
    bounds = unknown_bounds(problem, problem.anchor_values())
    scale = cost_scale(problem, values)
    monitor = Monitor(report, cancel)
    radius, earlier = FIRST_RADIUS, None
    coarse = thinned(problem, seed)
    if coarse is not None:
        # The thinned points lack the hard ones, so coverage is settled on the full set.
        level = _Level(bounds, scale, 1e-3, tolerated=0.01, may_add=False)
        found = _run_level(coarse[0], level, values, radius, None, monitor)
        values, radius = found.values, 0.3 * FIRST_RADIUS
        earlier = found.seen.among(problem, coarse[1])
    if coarse is None or not cancel.is_set():
        found = _run_level(problem, _Level(bounds, scale, 1e-4), values, radius, earlier, monitor)
    else:
        found = replace(found, merit=Merit(np.inf, 1.0, np.inf))
    return _result(found, monitor)


def _result(found: _LevelResult, monitor: Monitor) -> StartResult:
    return StartResult(
        found.values,
        found.merit,
        found.outcome,
        monitor.steps,
        monitor.outer_iterations,
        found.outcome.stopped,
        found.why,
        found.demands.added_points,
        found.demands.margins,
    )
