"""Which limits contradict each other, and by how much each would have to give way."""

from __future__ import annotations

import numpy as np

from common.progress import CancelToken
from geometry.arrays import Floats
from solver.coverage.visibilitycuts import views
from solver.nlp.iterate import Task
from solver.nlp.sqp import Outcome, minimise
from solver.outerloop import SATISFIED, all_candidates, covariance_cost, unknown_bounds
from solver.problem import Scene
from solver.result import Concession

_HARD = 1000.0
"""How much dearer a breach of the other families is, when one alone is asked to give way."""

_MAX_STEPS = 80


def conflicts(scene: Scene, values: Floats, cancel: CancelToken) -> tuple[Concession, ...]:
    """The limits that take part in the contradiction at the network nearest to meeting them.

    ``values`` (7 n,) is that network. A family takes part when it is broken there, or when it
    pushes back: its multipliers are what keeps the broken ones from being met. Each is then
    asked to give way alone.
    """
    seen = views(scene, scene.unknowns.state(values))
    rows = all_candidates(scene, scene.unknowns.state(values), seen)
    bounds = unknown_bounds(scene, scene.anchor_values())
    state = scene.unknowns.state(values)
    cost = covariance_cost(scene, seen, covariance_cost(scene, seen).typical(state))
    task = Task(scene.unknowns, cost, rows, bounds, ("coverage",))

    def watch(*_: float) -> bool:
        return not cancel.is_set()

    nearest = minimise(task, values, watch, max_iterations=_MAX_STEPS, price=1e3)
    breaches = task.breaches(nearest.values)
    out = []
    for name in _taking_part(task, nearest, breaches):
        unit, natural = _unit(task, name)
        alone = Task(
            scene.unknowns,
            cost,
            rows,
            bounds,
            ("coverage",),
            weights={f: _HARD for f in task.families if f != name},
        )
        found = minimise(alone, nearest.values, watch, max_iterations=_MAX_STEPS, price=100.0)
        left = alone.breaches(found.values)
        enough = all(left[f] <= 10.0 * SATISFIED for f in task.families if f != name)
        give = breaches[name] * natural if breaches[name] > SATISFIED else 0.0
        out.append(Concession(name, unit, give, left[name] * natural if enough else None))
    return (*out, *_coverage(scene, nearest.values))


def _taking_part(task: Task, nearest: Outcome, breaches: dict[str, float]) -> list[str]:
    """Families that are broken, and those whose multipliers are of the size of the price."""
    push = dict.fromkeys(task.families, 0.0)
    for block, multipliers in zip(task.rows, nearest.multipliers, strict=True):
        if block.block.family in push:
            push[block.block.family] += float(np.abs(multipliers).sum())
    broken = [f for f in task.families if breaches[f] > SATISFIED]
    if not broken:
        return []
    most = max(push[f] for f in broken)
    return [f for f in task.families if f in broken or push[f] > 0.05 * most]


def _unit(task: Task, family: str) -> tuple[str, float]:
    block = next(r.block for r in task.rows if r.block.family == family)
    return block.unit, block.natural


def _coverage(scene: Scene, values: Floats) -> list[Concession]:
    """Shares of points by which the coverage tiers are missed."""
    state = scene.unknowns.state(values)
    seen = views(scene, state).seen.sum(axis=0)
    out = []
    for tier in scene.limits.coverage.tiers:
        missing = tier.share - float((seen >= tier.views).mean())
        if missing > 0.0:
            out.append(Concession(f"coverage_{tier.views}", "", missing, missing))
    return out
