"""Matchable pairs among candidates: against counts by hand, and networks that hold together."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
import rigs

from common.progress import NeverCancelled
from solver.coverage.matchable import MatchableViews
from solver.design import design
from solver.infeasibility import _coverage
from solver.limits import BaseHeight, Coverage, CoverageTier, Limits
from solver.matching import Matching, PairTier
from solver.problem import Problem
from solver.quality import evaluate
from solver.search.candidates import Candidates, candidates, placed
from solver.search.exchange import exchange
from solver.search.matches import Matches
from solver.search.networks import Search
from solver.strategy import Strategy

STEP_DEG = 20.0
TIERS = (PairTier(1, 0.8), PairTier(2, 0.2))
MATCHING = Matching(max_angle_deg=35.0, least_shared=0.2, required=True, tiers=TIERS)
# Nothing but their cost draws cameras apart, and nothing but matching holds them together.
FREE = rigs.face_limits(base_height=BaseHeight(min=0.1), coverage=Coverage((CoverageTier(2, 0.9),)))


@cache
def pool(limits: Limits) -> Candidates:
    subject = rigs.face(30, 120)
    around = placed(subject, rigs.compact_camera(), limits, step_deg=STEP_DEG)
    return candidates(subject, limits, around)


def matches() -> Matches:
    found = pool(replace(FREE, matching=MATCHING)).matches
    assert found is not None
    return found


def by_hand(network: list[int]) -> int:
    """Groups too many and shares that lack of one network of candidates, as rules broken."""
    every = matches().views
    some = MatchableViews(
        every.matching,
        every.usable[network],
        every.centres_mm[network],
        every.points_mm,
        every.pixel_mm[network],
    )
    share = matches().share
    broken = len(some.groups) - 1
    for tier in TIERS:
        lack = tier.share + 0.003 - float(share[some.pairs_of_point >= tier.pairs].sum())
        broken += max(0, int(np.ceil((lack - 1e-9) / 0.005)))
    return broken


@pytest.mark.parametrize("count", [2, 3, 5])
def test_broken_rules_are_those_of_each_network_counted_by_hand(count: int) -> None:
    # Groups are told by shares of all points, candidates weigh those that can be matched: here
    # both are the same, which this asks first.
    assert matches().share.min() > 0.0
    rng = np.random.default_rng(count)
    found = set()
    for _ in range(12):
        network = rng.choice(len(pool(FREE)), count, replace=False)
        broken = matches().broken_with_each(network[:-1])[network[-1]]
        assert broken == by_hand(network.tolist())
        found.add(int(broken))
    assert len(found) > 1


def test_a_search_that_is_not_asked_weighs_no_pairs() -> None:
    assert pool(FREE).matches is None
    assert Search(pool(FREE), FREE).score(np.array([0, 5]))[0] == 0


def test_networks_hold_together_where_it_is_asked() -> None:
    asked = replace(FREE, matching=MATCHING)
    found = {}
    for name, limits in (("free", FREE), ("asked", asked)):
        search = Search(pool(limits), limits)
        best = exchange(search, 3, 0, NeverCancelled(), shakes=1)[0]
        cameras = tuple(
            replace(search.candidates.cameras[k], name=f"c{k}") for k in best.network.tolist()
        )
        found[name] = best, evaluate(rigs.face(30, 120), cameras, asked)
    best, quality = found["asked"]
    assert best.score[0] == 0
    assert len(quality.matchable.groups) == 1
    assert all(quality.matchable.share(t.pairs) >= t.share for t in TIERS)
    apart = found["free"][1]
    assert "groups" in {r.family for r in apart.violated}
    assert best.score[1] > found["free"][0].score[1]


def test_weights_are_of_the_points_that_any_two_candidates_could_match() -> None:
    limits = replace(FREE, matching=MATCHING)
    cameras = pool(limits).cameras[:2]
    subject = rigs.face(30, 120)
    seen = np.zeros((2, 30), dtype=bool)
    seen[0, :9] = seen[1, 4:] = True
    found = Matches.of(Problem(subject, cameras, limits), seen, np.full(30, 1 / 30))
    assert found is not None
    both = found.views.usable.all(axis=0)
    assert 0 < both.sum() <= 5
    np.testing.assert_allclose(found.share, both / both.sum())


@pytest.mark.slow
def test_a_design_keeps_what_is_asked_while_it_is_moved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("solver.design.placed", partial(placed, step_deg=STEP_DEG))
    subject, limits = rigs.face(30, 120), replace(FREE, matching=MATCHING)
    found = design(
        subject, rigs.compact_camera(), limits, count=3, starts=1, strategy=Strategy.K_MEANS
    )
    assert {s.kind for s in found.solver.starts} == {"exchange"}
    assert found.feasible, found.quality.violated
    assert len(found.quality.matchable.groups) == 1
    assert found.quality.cost_mm2 <= found.start_quality.cost_mm2


def test_what_lacks_is_named_among_the_conflicts() -> None:
    strict = replace(MATCHING, max_angle_deg=1.0)
    limits = replace(FREE, matching=strict)
    cameras = rigs.face_cameras(rigs.face(30, 120), 3, limits)
    problem = Problem(rigs.face(30, 120), cameras, limits)
    named = {c.family: c.amount for c in _coverage(problem, problem.start_values(), set())}
    assert named["groups"] == 2.0
    assert named["matchable_1"] == pytest.approx(TIERS[0].share)
