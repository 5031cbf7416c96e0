"""A short move of a good network: its rays are frozen, and what goes wrong is held on to.

The network is a point that meets the program of the move: every view that it has is held, and what
it sees is framed. Solving leads to where a held view gets hidden, or where a camera comes to see
what it did not. Each becomes a row that the network itself meets, and the program is solved again:
a cut keeps a view; a point that comes into view is framed if the network could have framed it, and
is kept out of view otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from solver.constraints.builders.coverage import cut_constraints, hidden_constraints
from solver.constraints.builders.rays import framing_violation
from solver.coverage.assignment import Margins
from solver.coverage.cuts import VisibilityCuts, cuts_for_hidden, opening_directions
from solver.coverage.hidden import KeptHidden, kept_hidden
from solver.coverage.views import (
    NEAR,
    NOWHERE,
    Reach,
    Views,
    framed_at,
    holding_scarce,
    views,
    with_points,
)
from solver.formulation import COVERAGE, SATISFIED, candidate_constraints, covariance_cost
from solver.nlp.program import NonlinearProgram
from solver.nlp.quadratic import stationarity
from solver.nlp.sqp import Outcome, Watch, minimise
from solver.problem import Problem
from solver.variables import FOCUS, KAPPA, PER_CAMERA, NetworkState

MARGINS = Margins(0.01, 0.0)
_PASSES = 4
_FIRST_GAIN = 1e-3
"""Of three steps, at which the first pass ends: rows that are added will change it anyway."""

_TRUSTED = 0.1
_EDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Held:
    """What a network holds on to while it is moved, beside its views.

    ``framed`` (n, q) of the check points; ``named`` (k,) check points that join the design points;
    ``cuts`` that keep views, ``hidden`` what is kept from coming into view.
    """

    framed: Bools
    named: Ints
    cuts: VisibilityCuts
    hidden: KeptHidden

    @classmethod
    def of(cls, framed: Bools) -> Held:
        """Nothing but what is seen at first."""
        return cls(framed, np.zeros(0, np.int64), VisibilityCuts.none(), KeptHidden.none())

    def naming(self, points: Ints) -> Held:
        """With more check points among the design points."""
        return replace(self, named=np.union1d(self.named, points))

    def seeing(self, framed: Bools) -> Held:
        """With the points framed that a network sees which was reached."""
        return replace(self, framed=framed, hidden=self.hidden.but(framed))


@dataclass(frozen=True)
class Effort:
    """How far a move may go, and how well it is solved: see :func:`solver.nlp.sqp.minimise`."""

    half: float
    tolerance: float
    gain: float
    steps: int


@dataclass(frozen=True, eq=False)
class Moved:
    """Where a move ended, and what was learned.

    ``clean``: nothing was lost and nothing came into view that is not held on to. ``edge``: whether
    the box ended the move. ``size``: how far it went, in length scales and radians, not counting
    roll and focus.
    """

    outcome: Outcome
    held: Held
    clean: bool
    edge: bool
    size: float


@dataclass(frozen=True, eq=False)
class _Frozen:
    """A network about which programs are made: its problem, unknowns (7 n,), state and views."""

    problem: Problem
    values: Floats
    state: NetworkState
    seen: Views
    bounds: tuple[Floats, Floats]
    scale: float

    @classmethod
    def at(
        cls,
        problem: Problem,
        values: Floats,
        named: Ints,
        reach: Reach,
        bounds: tuple[Floats, Floats],
        scale: float,
    ) -> _Frozen:
        """Cast the rays of a network, with every view promised that it has."""
        problem = with_points(problem, named)
        state = problem.unknowns.state(values)
        seen = views(problem, state, None, MARGINS, reach)
        return cls(
            problem, values, state, holding_scarce(problem, seen, problem.count), bounds, scale
        )

    def program(self, held: Held, half: float = np.inf) -> NonlinearProgram:
        """The network's program within a box about it."""
        seen = replace(self.seen, framed=held.framed)
        rows = candidate_constraints(self.problem, self.state, seen)
        rows += cut_constraints(self.problem, held.cuts, self.state)
        rows += hidden_constraints(self.problem, held.hidden, self.state)
        return NonlinearProgram(
            self.problem.unknowns,
            covariance_cost(self.problem, seen, self.scale),
            rows,
            box(self.values, half, self.bounds),
            COVERAGE,
        )

    def learned(self, values: Floats, held: Held, open_mm: Floats) -> tuple[Held, bool]:
        """What is held on to after unknowns (7 n,) were tried, and whether that is anything new."""
        after = self.problem.unknowns.state(values)
        lost = cuts_for_hidden(self.problem, after, self.seen.assigned, open_mm)
        camera, point = np.nonzero(framed_at(self.problem, after) & ~held.framed)
        if len(lost.camera) + len(camera) == 0:
            return held, False
        points_mm = self.problem.subject.check_points.points_mm[point]
        can = framing_violation(self.problem, self.state, camera, points_mm) <= SATISFIED
        framed = held.framed.copy()
        framed[camera[can], point[can]] = True
        out = kept_hidden(self.problem, self.state, after, camera[~can], point[~can])
        hidden = held.hidden.joined(out)
        return Held(framed, held.named, held.cuts.joined(lost), hidden), True


def box(values: Floats, half: float, bounds: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Bounds (7 n,) of one move; the focus is free, and the roll, which hardly matters."""
    reach = np.full(len(values), half)
    reach[FOCUS::PER_CAMERA] = reach[KAPPA::PER_CAMERA] = np.inf
    return np.maximum(bounds[0], values - reach), np.minimum(bounds[1], values + reach)


def short_move(
    problem: Problem,
    values: Floats,
    held: Held,
    effort: Effort,
    bounds: tuple[Floats, Floats],
    scale: float,
    watch: Watch,
    whole: bool = True,
) -> Moved:
    """Move a network (7 n,) within a box about it, its views held; ``scale`` the cost's unit.

    A network that is not ``whole``, for it lacks views, may win those that are near.
    """
    reach = NOWHERE if whole else NEAR
    frozen = _Frozen.at(problem, values, held.named, reach, bounds, scale)
    open_mm = opening_directions(frozen.problem, frozen.state, frozen.seen.assigned)
    found, steps, news, known = values, 0, True, None
    for k in range(_PASSES):
        radius = min(effort.half, _TRUSTED) * (1.0 if k == 0 else 0.3)
        program = frozen.program(held, effort.half)
        outcome = minimise(
            program,
            found,
            lambda *step, before=steps: watch(before + step[0], *step[1:]),
            tolerance=effort.tolerance,
            gain_tolerance=effort.gain if k > 0 else max(effort.gain, _FIRST_GAIN),
            known=known,
            max_iterations=effort.steps,
            radius=radius,
        )
        found, steps = outcome.values, steps + outcome.iterations
        held, news = frozen.learned(found, held, open_mm)
        if outcome.stopped or (k > 0 and not news and outcome.converged):
            break
        known = None if news else outcome.multipliers
    edge, size = _extent(frozen, found, program.bounds)
    return Moved(replace(outcome, iterations=steps), held, not news, edge, size)


def optimality_error(
    problem: Problem, values: Floats, held: Held, bounds: tuple[Floats, Floats], scale: float
) -> float:
    """How far from an optimum a network (7 n,) is, with all that it holds on to."""
    frozen = _Frozen.at(problem, values, held.named, NOWHERE, bounds, scale)
    return stationarity(frozen.program(held), values)


def _extent(frozen: _Frozen, values: Floats, bounds: tuple[Floats, Floats]) -> tuple[bool, float]:
    """Whether the box holds a move to the unknowns (7 n,), and how far it goes."""
    near = (values <= bounds[0] + _EDGE) & (bounds[0] > frozen.bounds[0])
    near |= (values >= bounds[1] - _EDGE) & (bounds[1] < frozen.bounds[1])
    free = frozen.problem.unknowns.free
    table = np.abs(values - frozen.values).reshape(-1, PER_CAMERA)
    counts = [k for k in range(PER_CAMERA) if k not in (KAPPA, FOCUS)]
    return bool(near[free].any()), float(table[:, counts].max(initial=0.0))
