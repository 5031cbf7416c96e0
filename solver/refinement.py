"""The last digits: the winner of all starts solved to tight optimality conditions."""

from __future__ import annotations

from threadpoolctl import threadpool_limits

from common.progress import CancelToken
from solver.coverage.visibilitycuts import (
    Cuts,
    cuts_for_hidden,
    opening_directions,
    views,
    with_points,
)
from solver.nlp.iterate import Task
from solver.nlp.sqp import Outcome, minimise
from solver.outerloop import StartResult, all_candidates, covariance_cost, unknown_bounds
from solver.problem import Scene

_RADIUS = 0.02
_MAX_STEPS = 120
_TIGHT = 1e-6


def polish(scene: Scene, result: StartResult, cancel: CancelToken) -> Outcome:
    """Solve to the optimality conditions from where a start ended, with the same promises."""
    with threadpool_limits(1):
        scene, values = with_points(scene, result.promised), result.values
        state = scene.unknowns.state(values)
        seen = views(scene, state, None, result.margins)
        opening = opening_directions(scene, state, seen.promises)
        cost = covariance_cost(scene, seen, covariance_cost(scene, seen).typical(state))
        rows = all_candidates(scene, state, seen)
        bounds = unknown_bounds(scene, scene.anchor_values())
        cuts = Cuts.none()
        found, known = values, None
        for _ in range(3):
            task = Task(scene.unknowns, cost, rows + cuts.rows(scene), bounds, ("coverage",))
            outcome = minimise(
                task,
                found,
                lambda *_: not cancel.is_set(),
                tolerance=_TIGHT,
                gain_tolerance=1e-13,
                known=known,
                max_iterations=_MAX_STEPS,
                radius=_RADIUS,
            )
            found, known = outcome.values, outcome.multipliers
            lost = cuts_for_hidden(scene, scene.unknowns.state(found), seen.promises, opening)
            if outcome.stopped or len(lost.camera) == 0:
                break
            cuts = cuts.joined(lost)
        return outcome
