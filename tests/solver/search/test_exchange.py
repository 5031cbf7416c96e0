"""From a subject to networks of named cameras: what is returned, and what a shake does."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import cache
from itertools import combinations

import numpy as np
import pytest
import rigs
from hypothesis import given, settings
from hypothesis import strategies as st
from made_pools import pool

from common.errors import CancelledError
from common.progress import CancelToken, NeverCancelled
from geometry.camera import RigCamera
from solver.limits import BaseHeight, Coverage, HalfSpace, Limits, Zones
from solver.quality import evaluate
from solver.request import Request
from solver.search import exchange as module
from solver.search.candidates import placed
from solver.search.exchange import Found, exchange, search_networks
from solver.search.networks import Search
from solver.strategy import Strategy
from solver.workers import Workers

NEVER = NeverCancelled()
LIMITS = rigs.face_limits(coverage=Coverage(), base_height=BaseHeight(min=0.15, neighbour_max=0.5))


@pytest.fixture(scope="module", autouse=True)
def coarser_candidates() -> Iterator[None]:
    """Fewer candidates and shakes than the search's own, for speed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "SHAKES", 6)
        patch.setattr(module, "FINER_SHAKES", 3)
        patch.setattr(module, "FINER", ((5.0, 12),))
        yield


def searched(
    limits: Limits = LIMITS, count: int = 3, cancel: CancelToken = NEVER
) -> list[tuple[RigCamera, ...]]:
    subject, camera = rigs.face(30, 60), rigs.compact_camera()
    request = Request(subject, camera, limits, count, 0, 8, (), None, Strategy.EXCHANGE)
    around = placed(subject, camera, limits, cancel, step_deg=14.0)
    return search_networks(request, around, cancel, Workers())


@cache
def networks() -> list[tuple[RigCamera, ...]]:
    return searched()


def test_networks_are_complete_named_in_order_and_different() -> None:
    found = networks()
    assert 1 <= len(found) <= 8
    for network in found:
        assert tuple(c.name for c in network) == rigs.names(3)
    places = {tuple(c.pose.position_rig_mm.tobytes() for c in n) for n in found}
    assert len(places) == len(found)


def test_the_best_network_comes_first_and_breaks_no_rule_about_pairs() -> None:
    costs = []
    for network in networks():
        quality = evaluate(rigs.face(30, 60), network, LIMITS)
        assert not [r for r in quality.violated if r.family.startswith("base_height")]
        assert not [r for r in quality.violated if r.family == "body_clearance"]
        costs.append(quality.cost_mm2)
    # 60 check points are all weighed, so search and evaluation agree on the order.
    assert costs == sorted(costs)


def test_the_same_seed_gives_the_same_networks() -> None:
    again = searched()
    for one, other in zip(networks(), again, strict=True):
        for a, b in zip(one, other, strict=True):
            assert a.pose.position_rig_mm.tobytes() == b.pose.position_rig_mm.tobytes()
            assert a.focus_distance_mm == b.focus_distance_mm


def test_a_finer_look_about_the_networks_never_ends_worse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FINER", ())
    coarse = searched()
    before, after = (
        evaluate(rigs.face(30, 60), found[0], LIMITS).cost_mm2 for found in (coarse, networks())
    )
    # The networks of the grid are among those of the finer look; sums differ in the last digits.
    assert after <= before * (1.0 + 1e-12)


def test_networks_kept_beside_each_other_differ_in_two_cameras() -> None:
    search = Search(pool(3), Limits(body_clearance_mm=None, sight_line_clearance_mm=None))
    found = exchange(search, 4, 0, NEVER, shakes=20)
    assert len(found) > 1
    for one, other in combinations(found, 2):
        assert len(set(one.network.tolist()) - set(other.network.tolist())) >= 2


def test_many_cameras_are_shaken_less_often() -> None:
    assert [module._shakes(160, rigs.names(n)) for n in (4, 9, 18, 24)] == [160, 160, 80, 60]


def test_chains_that_begin_apart_find_what_one_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    alone: list[float] = []
    together: list[float] = []
    for seed in range(6):
        search = Search(pool(seed), Limits(body_clearance_mm=None, sight_line_clearance_mm=None))
        monkeypatch.setattr(module, "CHAINS", 1)
        alone.append(exchange(search, 3, seed, NEVER, shakes=0)[0].score[1])
        monkeypatch.setattr(module, "CHAINS", 4)
        together.append(exchange(search, 3, seed, NEVER, shakes=0)[0].score[1])
    # Sums in another order differ in the last digits.
    gains = [one / many - 1.0 for one, many in zip(alone, together, strict=True)]
    assert min(gains) > -1e-12
    assert max(gains) > 1e-6


def test_what_helps_a_network_most_is_weighed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    search = Search(pool(3), Limits(body_clearance_mm=None, sight_line_clearance_mm=None))
    first = search.best_addition(np.array([4, 1, 7]))
    monkeypatch.setattr(Search, "scores_with_each", None)
    assert search.best_addition(np.array([7, 4, 1])) == first


def test_the_exchange_is_never_worse_than_a_network_it_is_given() -> None:
    search = Search(pool(5), Limits(body_clearance_mm=None, sight_line_clearance_mm=None))
    best = exchange(search, 4, 0, NEVER, shakes=40)[0]
    again = exchange(search, 4, 1, NEVER, shakes=0, starts=[best.network])[0]
    assert again.score <= best.score


def test_where_nobody_may_stand_there_is_no_network() -> None:
    far = Zones(allowed=(HalfSpace(np.array([0.0, 1.0, 0.0]), 5000.0),))
    limits = rigs.face_limits(zones=far, coverage=Coverage())
    assert searched(limits, 2) == []


def test_rules_that_no_network_can_keep_give_none() -> None:
    # All candidates stand about as far away, so no base is three times the height.
    limits = rigs.face_limits(base_height=BaseHeight(min=3.0), coverage=Coverage())
    assert searched(limits, 2) == []


def test_a_cancelled_search_says_so_before_it_looks() -> None:
    cancel = threading.Event()
    cancel.set()
    with pytest.raises(CancelledError):
        searched(count=2, cancel=cancel)


def test_an_exchange_that_is_told_to_stop_says_so() -> None:
    cancel = threading.Event()
    cancel.set()
    search = Search(pool(1), Limits(body_clearance_mm=None, sight_line_clearance_mm=None))
    with pytest.raises(CancelledError):
        exchange(search, 3, 0, cancel, shakes=5)


@settings(max_examples=8, deadline=None, derandomize=True)
@given(st.integers(0, 1000), st.integers(1, 5))
def test_a_shake_moves_at_most_three_free_cameras_and_keeps_the_rest(seed: int, count: int) -> None:
    search = Search(pool(seed), Limits(body_clearance_mm=None, sight_line_clearance_mm=None))
    network = search.grown(search.fixed, count)
    shaken = module._shaken(search, network, np.random.default_rng(seed))
    assert len(shaken) == len(network)
    assert set(search.fixed.tolist()) <= set(shaken.tolist())
    assert len(set(network.tolist()) - set(shaken.tolist())) <= min(3, count)
    assert (shaken < len(search.candidates)).all()
    # The rule forbids a place taken twice, and there is always a free one among the best dozen.
    assert search.score(shaken)[0] == 0


@settings(max_examples=4, deadline=None, derandomize=True)
@given(st.integers(0, 1000))
def test_shaking_never_ends_worse_than_exchanging_alone(seed: int) -> None:
    search = Search(pool(seed), Limits(body_clearance_mm=None, sight_line_clearance_mm=None))
    alone = search.score(search.exchanged(search.grown(search.fixed, 3)))
    found = exchange(search, 3, seed, NEVER, shakes=4)
    # Sums in another order differ in the last digits.
    assert found[0].score <= (alone[0], alone[1] * (1.0 + 1e-12))
    assert all(isinstance(f, Found) for f in found)
    for each in found:
        assert each.score == search.score(each.network)
