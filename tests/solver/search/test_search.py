"""The search among candidates: brute force on small pools, closed forms, no rule broken."""

from __future__ import annotations

import threading
from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
import rigs

from common.errors import CancelledError
from common.progress import NeverCancelled
from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.subject import Subject
from solver.information import covariance_norms, normal_matrices
from solver.limits import BaseHeight, Coverage, CoverageTier, HalfSpace, Limits, StandOff, Zones
from solver.problem import Problem
from solver.quality import evaluate
from solver.search.candidates import (
    HARDEST,
    OTHERS,
    WIDEST_DEG,
    Candidates,
    _weighed_points,
    candidates,
    directions,
    directions_about,
    placed,
)
from solver.search.exchange import exchange
from solver.search.networks import ROUGH, Search

STEP_DEG = 12.0
"""Coarser than the search's own, for speed."""

LIMITS = rigs.face_limits(base_height=BaseHeight(min=0.15, neighbour_max=0.5))


def weighed(
    subject: Subject,
    limits: Limits,
    fixed: tuple[RigCamera, ...] = (),
    step_deg: float = STEP_DEG,
    outward: Floats | None = None,
) -> Candidates:
    camera = rigs.compact_camera()
    around = placed(subject, camera, limits, step_deg=step_deg, outward=outward)
    return candidates(subject, limits, around, fixed)


@cache
def pool() -> Candidates:
    return weighed(rigs.face(60, 120), LIMITS)


def some(count: int, seed: int = 0) -> Candidates:
    """A few of the candidates, so that every network can be tried."""
    whole = pool()
    chosen = np.random.default_rng(seed).choice(len(whole), count, replace=False)
    return Candidates(
        tuple(whole.cameras[k] for k in chosen),
        whole.information[chosen],
        whole.seen[chosen],
        whole.share,
        whole.prior,
        whole.position_mm[chosen],
        whole.distance_mm[chosen],
        0,
    )


def brute_score(search: Search, network: tuple[int, ...]) -> tuple[int, float]:
    """The rule read out: rules broken and cost, matrix by matrix."""
    few, limits = search.candidates, search.limits
    broken = 0
    for i, j in combinations(network, 2):
        ratio = few.base_height[i, j]
        bodies = np.linalg.norm(few.position_mm[i] - few.position_mm[j])
        size = np.linalg.norm(few.cameras[i].camera.body.size_mm)
        broken += bool(ratio < limits.base_height.min or bodies < size)
    for i in network:
        broken += all(
            few.base_height[i, j] > limits.base_height.neighbour_max for j in network if j != i
        )
    total = few.information[list(network)].sum(axis=0)
    norms = []
    for xx, yy, zz, xy, xz, yz in total.T:
        n = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) + few.prior * np.eye(3)
        norms.append(np.linalg.norm(np.linalg.inv(n)))
    count = few.seen[list(network)].sum(axis=0)
    lack = max([0.0, *(t.share - (count >= t.views).mean() for t in limits.coverage.tiers)])
    return broken, float(np.mean(norms)) * (1.0 + 30.0 * lack)


def test_norms_of_inverses_are_those_of_numpy() -> None:
    rng = np.random.default_rng(1)
    a = rng.normal(size=(50, 3, 3))
    n = a @ a.transpose(0, 2, 1) + 0.1 * np.eye(3)
    entries = np.stack([n[:, 0, 0], n[:, 1, 1], n[:, 2, 2], n[:, 0, 1], n[:, 0, 2], n[:, 1, 2]])
    expected = np.linalg.norm(np.linalg.inv(n), axis=(1, 2))
    # Condition numbers up to about 1e3 leave 12 digits.
    np.testing.assert_allclose(covariance_norms(entries), expected, rtol=1e-11)


def test_directions_are_evenly_spread_about_the_facing_side() -> None:
    facing = np.array([0.6, -0.8, 0.0])
    found = directions(facing, STEP_DEG)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-12)
    away = np.degrees(np.arccos(np.clip(found @ facing, -1.0, 1.0)))
    assert WIDEST_DEG - STEP_DEG < away.max() <= WIDEST_DEG + 1e-6
    cosine = found @ found.T
    np.fill_diagonal(cosine, -1.0)
    nearest = np.degrees(np.arccos(np.clip(cosine.max(axis=1), -1.0, 1.0)))
    assert (nearest > 0.8 * STEP_DEG).all()
    assert (nearest < 1.05 * STEP_DEG).all()


def test_a_candidate_looked_at_closely_stands_where_all_that_it_sees_from_there_is_sharp() -> None:
    # So near a stand-off limit is off: what is seen changes with the distance.
    limits = replace(LIMITS, coverage=Coverage(), stand_off=StandOff(None, None))
    aside = np.array([0.5, -0.8, 0.1]) / np.sqrt(0.9)
    outward = directions(aside, 30.0)
    found = weighed(rigs.face(60, 400), limits, outward=outward)
    assert len(found) > 5
    for camera in found.cameras:
        quality = evaluate(rigs.face(60, 400), (camera,), limits)
        assert quality.feasible, quality.violated


def test_finer_directions_lie_in_two_rings_about_the_given_ones() -> None:
    given = np.array([[0.6, -0.8, 0.0], [0.0, 0.0, 1.0]])
    found = directions_about(given, 3.0).reshape(2, 13, 3)
    for centre, ring in zip(given, found, strict=True):
        away = np.degrees(np.arccos(np.clip(ring @ centre, -1.0, 1.0)))
        # An arc cosine near 1 loses half of the sixteen digits.
        np.testing.assert_allclose(np.sort(away), [0.0] + 6 * [3.0] + 6 * [6.0], atol=1e-5)
        gaps = np.degrees(np.arccos(np.clip(ring @ ring.T - 2.0 * np.eye(13), -1.0, 1.0)))
        assert gaps.min() > 2.9


def test_points_that_fewest_see_are_weighed_one_by_one_and_the_others_stand_for_all() -> None:
    often = np.random.default_rng(2).permutation(5000)
    chosen, share = _weighed_points(often)
    hardest = np.flatnonzero(often < HARDEST)
    assert set(hardest.tolist()) <= set(chosen.tolist())
    np.testing.assert_allclose(share[np.isin(chosen, hardest)], 1.0 / 5000.0)
    assert share.sum() == pytest.approx(1.0)
    assert (np.diff(chosen) > 0).all()
    assert OTHERS <= len(chosen) - HARDEST <= 2 * OTHERS


def test_few_points_are_all_weighed_alike() -> None:
    chosen, share = _weighed_points(np.zeros(120, np.int64))
    np.testing.assert_array_equal(chosen, np.arange(120))
    np.testing.assert_allclose(share, 1.0 / 120.0)


def test_a_candidate_alone_holds_frame_focus_and_stand_off() -> None:
    subject = rigs.face(60, 120)
    for k in range(0, len(pool()), 17):
        quality = evaluate(subject, (pool().cameras[k],), replace(LIMITS, coverage=Coverage()))
        assert {r.family for r in quality.violated} <= set(), quality.violated


def test_the_information_of_candidates_is_that_of_the_evaluation() -> None:
    subject = rigs.face(60, 120)
    network = (3, 60, 100)
    cameras = tuple(pool().cameras[k] for k in network)
    entries = pool().information[list(network)].sum(axis=0)
    entries[:3] += pool().prior
    problem = Problem(subject, cameras, LIMITS)
    weight = pool().seen[list(network)] * problem.ray_weight[:, None]
    state = problem.unknowns.state(problem.start_values())
    points = problem.scaled(subject.check_points.points_mm)
    normal = normal_matrices(state, points, weight, problem.prior) / problem.length_mm**2
    np.testing.assert_allclose(entries[0], normal[:, 0, 0], rtol=1e-9)
    np.testing.assert_allclose(entries[5], normal[:, 1, 2], rtol=1e-6, atol=1e-6 * normal.max())
    quality = evaluate(subject, cameras, LIMITS)
    assert covariance_norms(entries).mean() == pytest.approx(quality.cost_mm2, rel=1e-6)


def test_scores_are_the_rule_read_out() -> None:
    search = Search(some(9), LIMITS)
    for network in combinations(range(9), 3):
        broken, cost = search.score(np.array(network))
        expected = brute_score(search, network)
        assert broken == expected[0]
        assert cost == pytest.approx(expected[1], rel=1e-9)


@pytest.mark.parametrize("views", [2, 3])
def test_candidates_are_ranked_as_whole_networks_are_scored(views: int) -> None:
    limits = replace(LIMITS, coverage=Coverage((CoverageTier(views, 0.99),)))
    search = Search(pool(), limits)
    for rest in (np.array([2, 40]), np.array([7, 21, 66])):
        broken, cost = search.scores_with_each(rest, len(pool()))
        exact = [search.score(np.append(rest, k)) for k in range(len(pool()))]
        np.testing.assert_array_equal(broken, [b for b, _ in exact])
        np.testing.assert_allclose(cost, [c for _, c in exact], rtol=ROUGH)


@pytest.mark.parametrize("seed", range(4))
def test_no_single_exchange_helps_an_exchanged_network(seed: int) -> None:
    search = Search(some(14, seed), LIMITS)
    found = search.exchanged(np.array([0, 1, 2]))
    best = search.score(found)
    for k in range(3):
        for other in set(range(14)) - set(found.tolist()):
            trial = found.copy()
            trial[k] = other
            broken, cost = search.score(trial)
            assert (broken, cost * (1.0 + 1e-8)) >= best


@pytest.mark.parametrize("seed", range(4))
def test_the_exchange_finds_the_best_of_all_networks_of_a_small_pool(seed: int) -> None:
    search = Search(some(12, seed), LIMITS)
    best = min(search.score(np.array(n)) for n in combinations(range(12), 3))
    found = exchange(search, 3, 0, NeverCancelled(), shakes=20)
    assert found[0].score[0] == best[0]
    assert found[0].score[1] == pytest.approx(best[1], rel=1e-9)
    assert [f.score for f in found] == sorted(f.score for f in found)


def test_growing_adds_the_view_that_helps_most_and_never_harms() -> None:
    search = Search(some(20), replace(LIMITS, base_height=BaseHeight(), coverage=Coverage()))
    network = search.grown(np.zeros(0, np.int64), 1)
    for _ in range(4):
        more = search.grown(network, len(network) + 1)
        np.testing.assert_array_equal(more[:-1], network)
        trials = [
            search.score(np.append(network, k)) for k in set(range(20)) - set(network.tolist())
        ]
        assert search.score(more) == min(trials)
        assert search.score(more)[1] < search.score(network)[1]
        network = more


def test_fixed_cameras_stay_in_every_network() -> None:
    subject = rigs.face(60, 120)
    old = replace(pool().cameras[10], name="old", fixed=True)
    with_old = weighed(subject, LIMITS, (old,))
    assert with_old.fixed == 1
    assert with_old.cameras[-1] is old
    search = Search(with_old, LIMITS)
    for found in exchange(search, 2, 0, NeverCancelled(), shakes=2):
        assert len(found.network) == 3
        assert (found.network == len(with_old) - 1).sum() == 1


def test_nobody_stands_where_a_zone_forbids() -> None:
    above = Zones(allowed=(HalfSpace(np.array([0.0, 0.0, 1.0]), 0.0),))
    allowed = weighed(rigs.face(60, 120), replace(LIMITS, zones=above))
    assert 0 < len(allowed) < len(pool())
    assert (allowed.position_mm[:, 2] > 0.0).all()
    nowhere = Zones(allowed=(HalfSpace(np.array([0.0, 1.0, 0.0]), 5000.0),))
    none = weighed(rigs.face(60, 120), replace(LIMITS, zones=nowhere))
    assert len(none) == 0


def test_the_stand_off_is_kept_to() -> None:
    far = replace(LIMITS, stand_off=StandOff(1200.0, 1300.0))
    found = weighed(rigs.face(60, 120), far)
    np.testing.assert_allclose(found.distance_mm, 1200.0, rtol=0.02)


def test_missing_views_raise_the_cost() -> None:
    few = some(6)
    none = Search(few, replace(LIMITS, coverage=Coverage()))
    three = Search(few, replace(LIMITS, coverage=Coverage((CoverageTier(3, 1.0),))))
    network = np.array([0, 1])
    assert three.score(network)[1] == pytest.approx(31.0 * none.score(network)[1])


def test_a_cancelled_search_stops() -> None:
    cancel = threading.Event()
    cancel.set()
    with pytest.raises(CancelledError):
        placed(rigs.face(60, 120), rigs.compact_camera(), LIMITS, cancel=cancel)


@pytest.mark.parametrize("size", [1, 2, 4])
def test_a_network_is_judged_alike_whole_and_camera_by_camera(size: int) -> None:
    search = Search(pool(), LIMITS)
    rng = np.random.default_rng(size)
    for _ in range(10):
        network = rng.choice(len(pool()), size, replace=False)
        broken, _ = search.scores_with_each(network[:-1])
        assert search.broken(network) == broken[network[-1]]
    if size == 1:
        # Nobody is too far from a camera that is alone.
        assert search.broken(network) == 0
