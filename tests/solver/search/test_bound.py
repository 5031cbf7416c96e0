"""The lower bound: below every network of small pools, and near to the best of them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
import rigs

from common.errors import CancelledError
from common.progress import NeverCancelled
from geometry.arrays import Bools
from solver.quality import evaluate
from solver.search.bound import bound_of, lower_bound
from solver.search.candidates import Candidates, candidates, placed
from solver.search.networks import covariance_norms


@cache
def pool() -> Candidates:
    subject, limits = rigs.face(60, 120), rigs.face_limits()
    around = placed(subject, rigs.compact_camera(), limits, step_deg=20.0)
    whole = candidates(subject, limits, around)
    chosen = np.random.default_rng(3).choice(len(whole), 12, replace=False)
    return replace(
        whole,
        cameras=tuple(whole.cameras[k] for k in chosen),
        information=whole.information[chosen],
        seen=whole.seen[chosen],
        position_mm=whole.position_mm[chosen],
        distance_mm=whole.distance_mm[chosen],
    )


def best_of_all(stands: Bools, count: int) -> float:
    """The least cost of any network, every one of them tried."""
    found = np.inf
    for network in combinations(np.flatnonzero(~stands), count):
        chosen = [*np.flatnonzero(stands), *network]
        entries = pool().information[chosen].sum(axis=0)
        entries[:3] += pool().prior
        found = min(found, float(covariance_norms(entries) @ pool().share))
    return found


@pytest.mark.parametrize(("count", "fixed"), [(4, 0), (6, 0), (3, 2), (10, 2)])
def test_no_network_is_below_the_bound_and_the_best_is_near(count: int, fixed: int) -> None:
    stands = np.zeros(12, dtype=np.bool_)
    stands[:fixed] = True
    best, lower = best_of_all(stands, count), lower_bound(pool(), stands, count)
    assert lower <= best
    # The fewer are taken, the more evenly weights are shared than any choice can be.
    assert lower > 0.5 * best
    if count == 10:
        # All candidates are taken, so that there is nothing to relax: 0.3 % is where it stops.
        assert lower == pytest.approx(best, rel=0.004)


def test_a_design_is_told_beside_its_bound() -> None:
    subject, limits = rigs.face(40, 60), rigs.face_limits()
    cameras = rigs.face_cameras(subject, 4)
    placed = (*(replace(c, fixed=True) for c in cameras[:2]), *cameras[2:])
    found = bound_of(subject, rigs.compact_camera(), limits, placed)
    assert found is not None
    assert 0.0 < found.lower_mm2 < found.cost_mm2
    # All 60 check points are weighed alike, so the cost is that of the evaluation.
    assert found.points == 60
    assert found.cost_mm2 == pytest.approx(evaluate(subject, placed, limits).cost_mm2)
    assert found.unseen_share == 0.0


def test_a_bound_can_be_cancelled() -> None:
    class Cancelled(NeverCancelled):
        def is_set(self) -> bool:
            return True

    with pytest.raises(CancelledError):
        lower_bound(pool(), np.zeros(12, dtype=np.bool_), 3, Cancelled())
