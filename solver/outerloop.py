"""From one start to one network: solve, look again, until nothing changes.

A round freezes which rays are seen and which views are promised, and solves a smooth
programme. Then the rays are cast anew. A round counts only when the network it found is
better with the rays it really has, so a point cannot be lost unnoticed. The first rounds work
on a thinned set of points; the last ones on all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from common.progress import CancelToken
from geometry.arrays import Floats, Ints
from solver.constraints.body_candidates import body_rows
from solver.constraints.candidates import Candidates
from solver.constraints.pose_candidates import place_rows
from solver.constraints.ray_candidates import ray_rows
from solver.coverage.assignment import Margins
from solver.coverage.visibilitycuts import (
    FIRST_MARGINS,
    Cuts,
    Views,
    cuts_for_hidden,
    judge,
    opening_directions,
    views,
    with_points,
)
from solver.information import CovarianceCost
from solver.nlp.iterate import Task
from solver.nlp.sqp import FIRST_RADIUS, Outcome, minimise
from solver.problem import Scene
from solver.variables import FOCUS, PER_CAMERA, NetworkState

Report = Callable[[int, int, float, float], None]
"""Called with round, iteration, cost relative to the start's, violation."""

MAX_ROUNDS = 12
MAX_HORIZON_PASSES = 4
MAX_STEPS = 40
MAX_PROMISE_PRICE = 1e3
SATISFIED = 2e-6
"""Rows count as satisfied within this, in the solver's units of order one; polishing makes it
less."""

SETTLED = 1e-3
"""Relative gain below which another round is not worth its time."""

THINNED_POINTS = 250
"""Points of the first rounds: enough for the shape of the network, quick to solve."""


@dataclass(frozen=True, eq=False)
class Merit:
    """How good a network really is: breach of limits and of coverage first, then the cost."""

    breach: float
    shortfall: float
    cost: float

    @property
    def feasible(self) -> bool:
        """Whether all limits of the design points hold."""
        return self.breach <= SATISFIED and self.shortfall <= 0.0

    def better_than(self, other: Merit | None) -> bool:
        """Feasible beats infeasible; then less breach and shortfall; then less cost."""
        if other is None or self.feasible != other.feasible:
            return other is None or self.feasible
        if self.feasible:
            return self.cost < other.cost
        return (self.breach + self.shortfall, self.cost) < (
            other.breach + other.shortfall,
            other.cost,
        )


@dataclass(frozen=True, eq=False)
class StartResult:
    """What came of one start: unknowns (7 n,), merit and how it went.

    ``promised`` are check points that had to be promised views by name, ``margins`` what was
    promised beyond the limits: whoever goes on from here has to promise the same.
    """

    values: Floats
    merit: Merit
    outcome: Outcome
    iterations: int
    rounds: int
    stopped: bool
    why: str
    promised: Ints
    margins: Margins


@dataclass(eq=False)
class _Work:
    """One level (thinned or full) of one start."""

    scene: Scene
    bounds: tuple[Floats, Floats]
    report: Report
    cancel: CancelToken
    cost_scale: float
    iterations: int = 0
    round: int = 0
    promise_price: float = 10.0
    margins: Margins = FIRST_MARGINS
    tolerated: float = 0.0
    may_add: bool = True
    promised: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    cuts: Cuts = field(default_factory=Cuts.none)
    seen: Views | None = None

    def watch(self, iteration: int, cost: float, breach: float) -> bool:
        self.report(self.round, self.iterations + iteration, cost, breach)
        return not self.cancel.is_set()


def unknown_bounds(scene: Scene, start: Floats) -> tuple[Floats, Floats]:
    """Bounds (7 n,) of all unknowns: Eq 8 about ``start``, and the focus range."""
    low, high = np.full(len(start), -np.inf), np.full(len(start), np.inf)
    box, scale = scene.limits.bounds, scene.length_mm
    if box is not None:
        half = [
            np.inf if v is None else np.radians(v)
            for v in (box.omega_deg, box.phi_deg, box.kappa_deg)
        ]
        half += [np.inf if v is None else v / scale for v in (box.x_mm, box.y_mm, box.z_mm)]
        half.append(np.inf)
        low, high = start - np.tile(half, scene.count), start + np.tile(half, scene.count)
    for k, camera in enumerate(scene.cameras):
        at = PER_CAMERA * k + FOCUS
        low[at] = camera.camera.min_focus_distance_mm / scale
        high[at] = np.inf
    return low, high


def covariance_cost(scene: Scene, seen: Views, scale: float = 1.0) -> CovarianceCost:
    """The cost with the rays that are seen now."""
    weight = seen.seen * scene.ray_weight[:, None]
    return CovarianceCost(scene.points, weight, scene.prior, scale)


def all_candidates(scene: Scene, state: NetworkState, seen: Views) -> list[Candidates]:
    """Every row that the limits ask for at this state."""
    return (
        ray_rows(scene, seen.framed, seen.promises, seen.margin_deg)
        + place_rows(scene, state)
        + body_rows(scene, state)
    )


def merit(
    scene: Scene,
    values: Floats,
    seen: Views,
    rows: list[Candidates],
    bounds: tuple[Floats, Floats],
    shortfall: float,
) -> Merit:
    """The true merit of a network whose rays are ``seen`` and whose rows are ``rows``."""
    state = scene.unknowns.state(values)
    watched = [
        r.block.violation(state).max(initial=0.0) for r in rows if r.block.family != "coverage"
    ]
    free = scene.unknowns.free
    out = np.maximum(bounds[0] - values, values - bounds[1])[free].max(initial=0.0)
    cost = covariance_cost(scene, seen).value(state)
    return Merit(float(max([out, 0.0, *watched])), shortfall, cost)


def _solve_round(
    work: _Work, values: Floats, seen: Views, rows: list[Candidates], gain: float, radius: float
) -> Outcome:
    """Solve with the rays frozen; add a horizon for each promised view that gets hidden."""
    scene = work.scene
    state = scene.unknowns.state(values)
    opening = opening_directions(scene, state, seen.promises)
    hidden = cuts_for_hidden(scene, state, seen.promises, opening)
    work.cuts = work.cuts.of(seen.promises).joined(hidden)
    cost = covariance_cost(scene, seen, work.cost_scale)
    known = None
    for attempt in range(MAX_HORIZON_PASSES):
        task = Task(
            scene.unknowns,
            cost,
            rows + work.cuts.rows(scene),
            work.bounds,
            ("coverage",),
            work.promise_price,
        )
        # What a horizon will change anyway need not be computed to the last digit first.
        patience = max(gain, 1e-3) if attempt == 0 else gain
        outcome = minimise(
            task,
            values,
            work.watch,
            gain_tolerance=patience,
            radius=radius,
            known=known,
            max_iterations=MAX_STEPS,
        )
        work.iterations += outcome.iterations
        values, known, radius = outcome.values, outcome.multipliers, 0.25 * FIRST_RADIUS
        lost = cuts_for_hidden(scene, scene.unknowns.state(values), seen.promises, opening)
        work.cuts = work.cuts.joined(lost)
        if outcome.stopped or (len(lost.camera) == 0 and patience == gain):
            break
    return outcome


def _level(
    work: _Work, values: Floats, gain: float, radius: float, earlier: Views | None
) -> tuple[Floats, Merit, Outcome, str]:
    """Rounds on one set of points until they settle; the best network of all rounds."""
    scene = work.scene
    state = scene.unknowns.state(values)
    seen = views(scene, state, earlier)
    rows = all_candidates(scene, state, seen)
    best: tuple[Floats, Merit, Outcome] | None = None
    why = f"the limit of {MAX_ROUNDS} rounds was reached"
    for _ in range(MAX_ROUNDS):
        work.round += 1
        outcome = _solve_round(work, values, seen, rows, gain, radius)
        state = scene.unknowns.state(outcome.values)
        judged = judge(scene, state)
        shortfall = max(0.0, judged.shortfall - work.tolerated)
        if shortfall > 0.0:
            work.promise_price = min(2.0 * work.promise_price, MAX_PROMISE_PRICE)
            work.margins = work.margins.wider(shortfall)
            if work.may_add:
                work.promised = np.union1d(work.promised, judged.missed)
                work.scene = scene = with_points(scene, judged.missed)
        seen = views(scene, state, seen, work.margins)
        rows = all_candidates(scene, state, seen)
        now = merit(scene, outcome.values, seen, rows, work.bounds, shortfall)
        before = None if best is None else best[1]
        if now.better_than(before):
            best = (outcome.values, now, outcome)
        if outcome.stopped:
            why = outcome.why
            break
        if before is not None and not _worth_another(before, now):
            why = f"another round gained less than {SETTLED:g} of the cost"
            break
        values, radius = outcome.values, 0.3 * FIRST_RADIUS
    assert best is not None  # noqa: S101 - the loop runs at least once
    work.seen = seen
    return (*best, why)


def _worth_another(before: Merit, now: Merit) -> bool:
    # While a limit is broken, or was until now, rounds still bring points into the frame.
    if not now.feasible or not before.feasible:
        return True
    return now.cost < before.cost * (1.0 - SETTLED)


def thinned(scene: Scene, seed: int) -> tuple[Scene, Ints] | None:
    """The same scene with a random choice of its design points, and which; None if it has few."""
    count = len(scene.subject.design_points)
    if count <= 2 * THINNED_POINTS:
        return None
    chosen = np.sort(np.random.default_rng(seed).choice(count, THINNED_POINTS, replace=False))
    points = scene.subject.design_points.subset(chosen)
    return replace(
        scene, subject=replace(scene.subject, design_points=points), origin=scene.origin_mm
    ), chosen


def run_start(scene: Scene, report: Report, cancel: CancelToken, seed: int = 0) -> StartResult:
    """Optimise from the scene's own cameras as the start."""
    values = scene.start_values()
    bounds = unknown_bounds(scene, scene.anchor_values())
    state = scene.unknowns.state(values)
    scale = covariance_cost(scene, views(scene, state)).typical(state)
    iterations, rounds, radius, earlier = 0, 0, FIRST_RADIUS, None
    coarse = thinned(scene, seed)
    if coarse is not None:
        # The thinned points lack the hard places, so coverage is settled on the full set.
        work = _Work(coarse[0], bounds, report, cancel, scale, tolerated=0.01, may_add=False)
        values, _, outcome, why = _level(work, values, 1e-3, radius, None)
        iterations, rounds, radius = work.iterations, work.round, 0.3 * FIRST_RADIUS
        earlier = None if work.seen is None else work.seen.among(scene, coarse[1])
    if not cancel.is_set():
        work = _Work(scene, bounds, report, cancel, scale, iterations, rounds)
        values, found, outcome, why = _level(work, values, 1e-4, radius, earlier)
    else:
        found = Merit(np.inf, 1.0, np.inf)
    return StartResult(
        values,
        found,
        outcome,
        work.iterations,
        work.round,
        outcome.stopped,
        why,
        work.promised,
        work.margins,
    )
