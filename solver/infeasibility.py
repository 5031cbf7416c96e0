"""Which limits contradict each other, and by how much each would have to give way."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from common.progress import CancelToken
from geometry.arrays import Floats
from solver.coverage.matchable import lacks
from solver.coverage.views import centres_mm, views
from solver.coverage.visibility import cast_rays
from solver.formulation import (
    COVERAGE,
    SATISFIED,
    candidate_constraints,
    covariance_cost,
    unknown_bounds,
)
from solver.nlp.program import NonlinearProgram
from solver.nlp.sqp import Outcome, minimise
from solver.problem import Problem
from solver.quality import evaluate
from solver.result import Quality, Relaxation

_HARD = 1000.0
"""How much dearer a violation of the other families is, when one alone is asked to give way."""

_MAX_STEPS = 80


def conflicts(problem: Problem, values: Floats, cancel: CancelToken) -> tuple[Relaxation, ...]:
    """The limits that take part in the contradiction at the network nearest to meeting them.

    ``values`` (7 n,) is that network. A family takes part when it is broken there, or when it
    pushes back: its multipliers are what keeps the broken ones from being met. Each is then
    asked to give way alone. Told are those that give way, and those that would be enough alone,
    by how much the table of limits says that they are missed.
    """
    seen = views(problem, problem.unknowns.state(values))
    rows = candidate_constraints(problem, problem.unknowns.state(values), seen)
    bounds = unknown_bounds(problem, problem.anchor_values())
    state = problem.unknowns.state(values)
    cost = covariance_cost(problem, seen, covariance_cost(problem, seen).typical(state))
    program = NonlinearProgram(problem.unknowns, cost, rows, bounds, COVERAGE)

    def watch(*_: float) -> bool:
        return not cancel.is_set()

    nearest = minimise(program, values, watch, max_iterations=_MAX_STEPS, penalty=1e3)
    violations = program.violations(nearest.values)
    out: list[Relaxation] = []
    for name in _taking_part(program, nearest, violations):
        alone = NonlinearProgram(
            problem.unknowns,
            cost,
            rows,
            bounds,
            COVERAGE,
            weights={f: _HARD for f in program.families if f != name},
        )
        found = minimise(alone, nearest.values, watch, max_iterations=_MAX_STEPS, penalty=100.0)
        left = alone.violations(found.values)
        enough = all(left[f] <= 10.0 * SATISFIED for f in program.families if f != name)
        out += _relaxations(problem, name, nearest.values, found.values if enough else None)
    return (*out, *_coverage(problem, nearest.values, {c.family for c in out}))


def missed(quality: Quality, families: tuple[str, ...]) -> tuple[Relaxation, ...]:
    """What a network that nobody optimised misses of limits whose names begin with ``families``."""
    worst: dict[str, Relaxation] = {}
    for row in (r for r in quality.violated if r.family.startswith(families)):
        before = worst.get(row.family)
        if before is None or -row.slack > before.amount:
            worst[row.family] = Relaxation(row.family, row.unit, -row.slack, None)
    return tuple(worst.values())


def _relaxations(
    problem: Problem, family: str, nearest: Floats, alone: Floats | None
) -> Iterator[Relaxation]:
    """What a family gives in the nearest network and in the one where it alone gives way."""
    now, then = _missed(problem, family, nearest), _missed(problem, family, alone)
    for name in dict.fromkeys((*now, *then)):
        unit, amount = now.get(name, (then.get(name, ("", 0.0))[0], 0.0))
        enough = then.get(name, (unit, 0.0))[1] if alone is not None else None
        # A family that neither gives nor would be enough helps nobody.
        if amount > 0.0 or enough:
            yield Relaxation(name, unit, amount, enough)


def _missed(problem: Problem, family: str, values: Floats | None) -> dict[str, tuple[str, float]]:
    """Unit and amount by which each limit of a family is missed, as the table of limits has it."""
    if values is None:
        return {}
    placed = problem.placed(values)
    table = evaluate(problem.subject, placed, problem.limits, problem.anchor).constraints
    out: dict[str, tuple[str, float]] = {}
    for row in table:
        if (row.family == family or row.family.startswith(f"{family}_")) and not row.satisfied:
            out[row.family] = row.unit, max(-row.slack, out.get(row.family, ("", 0.0))[1])
    return out


def _taking_part(
    program: NonlinearProgram, nearest: Outcome, violations: dict[str, float]
) -> list[str]:
    """Families that are broken, and those whose multipliers are of the size of the penalty."""
    push = dict.fromkeys(program.families, 0.0)
    for block, multipliers in zip(program.rows, nearest.multipliers, strict=True):
        if block.block.family in push:
            push[block.block.family] += float(np.abs(multipliers).sum())
    broken = [f for f in program.families if violations[f] > SATISFIED]
    if not broken:
        return []
    most = max(push[f] for f in broken)
    return [f for f in program.families if f in broken or push[f] > 0.05 * most]


def _coverage(problem: Problem, values: Floats, told: set[str]) -> list[Relaxation]:
    """Shares of points by which the coverage tiers are missed that are not ``told`` yet."""
    state = problem.unknowns.state(values)
    seen = views(problem, state).seen.sum(axis=0)
    out = []
    for tier in problem.limits.coverage.tiers:
        missing = tier.share - float((seen >= tier.views).mean())
        if missing > 0.0 and f"coverage_{tier.views}" not in told:
            out.append(Relaxation(f"coverage_{tier.views}", "", missing, missing))
    check, limit = problem.subject.check_points, problem.limits.incidence.ray_max_deg
    position, eyes = problem.visibility_positions[0], centres_mm(problem, state)
    found = cast_rays(check, problem.subject.occluder, eyes, limit, (position,))
    lacking = lacks(problem, state, position, found)
    return out + [Relaxation(name, "", lack, lack) for name, lack in lacking.items()]
