"""Networks that are built once: each step is the best of all that there are, tried one by one."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import partial

import numpy as np
import pytest
import rigs
from hypothesis import given, settings
from hypothesis import strategies as st
from made_pools import pool

from common.errors import CancelledError
from common.progress import NeverCancelled
from solver.design import design
from solver.limits import BaseHeight, Coverage, Limits
from solver.request import Request
from solver.search.built import Build, built_network, filtered, next_best_views
from solver.search.candidates import placed
from solver.search.networks import Search
from solver.strategy import Strategy

NEVER = NeverCancelled()
BUILDS = (next_best_views, filtered)


def search(seed: int, base_height: BaseHeight | None = None) -> Search:
    """The made-up cameras all look the same way, so nobody asks what is in their view."""
    limits = Limits(
        coverage=Coverage(),
        base_height=base_height or BaseHeight(),
        body_clearance_mm=None,
        sight_line_clearance_mm=None,
    )
    return Search(pool(seed), limits)


@pytest.mark.parametrize("build", BUILDS)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 6))
@settings(max_examples=8, deadline=None)
def test_so_many_free_cameras_beside_all_fixed_ones(build: Build, seed: int, count: int) -> None:
    network = build(search(seed), count, NEVER)
    assert len(set(network.tolist())) == len(network) == count + 2
    assert {23, 24} <= set(network.tolist())


@given(seed=st.integers(0, 10_000))
@settings(max_examples=5, deadline=None)
def test_each_next_view_is_the_one_that_helps_most(seed: int) -> None:
    made = search(seed)
    network = next_best_views(made, 4, NEVER)
    for k in range(2, 6):
        others = [c for c in range(23) if c not in network[:k]]
        scores = [made.score(np.append(network[:k], c)) for c in others]
        assert made.score(network[: k + 1]) == pytest.approx(min(scores), rel=1e-9)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=5, deadline=None)
def test_what_is_filtered_out_is_missed_least(seed: int) -> None:
    made = search(seed)
    for count in range(5, 1, -1):
        before, after = filtered(made, count + 1, NEVER), filtered(made, count, NEVER)
        assert len(np.setdiff1d(before, after)) == 1
        scores = [made.score(np.delete(before, k)) for k in np.flatnonzero(before < 23)]
        assert made.score(after) == pytest.approx(min(scores), rel=1e-9)


@pytest.mark.parametrize("build", BUILDS)
def test_cameras_too_close_to_each_other_are_not_both_taken(build: Build) -> None:
    for seed in range(5):
        made = search(seed, base_height=BaseHeight(min=0.5))
        network = build(made, 4, NEVER)
        assert made.score(network)[0] == 0
        close = made.too_close[np.ix_(network, network)] & ~np.eye(6, dtype=bool)
        assert not close.any()


@pytest.mark.parametrize("build", BUILDS)
def test_a_build_ends_soon_after_it_is_cancelled(build: Build) -> None:
    cancelled = threading.Event()
    cancelled.set()
    with pytest.raises(CancelledError):
        build(search(0), 3, cancelled)


@pytest.fixture
def coarser_candidates() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("solver.design.placed", partial(placed, step_deg=14.0))
        yield


@pytest.mark.parametrize("build", BUILDS)
def test_no_network_where_its_rules_cannot_be_kept(build: Build) -> None:
    limits = rigs.face_limits(coverage=Coverage(), base_height=BaseHeight(min=3.0))
    subject, camera = rigs.face(20, 40), rigs.compact_camera()
    request = Request(subject, camera, limits, 3, 0, 8, (), None, Strategy.FILTERING)
    around = placed(subject, camera, limits, NEVER, step_deg=14.0)
    assert built_network(request, around, NEVER, build) == []


@pytest.mark.usefixtures("coarser_candidates")
@pytest.mark.parametrize("strategy", [Strategy.NEXT_BEST_VIEW, Strategy.FILTERING, Strategy.STRIP])
def test_a_design_begins_as_it_is_told(strategy: Strategy) -> None:
    limits = rigs.face_limits(coverage=Coverage())
    found = design(
        rigs.face(20, 40), rigs.compact_camera(), limits, count=3, starts=1, strategy=strategy
    )
    assert {s.kind for s in found.solver.starts} == {strategy.value}
    assert found.solver.starts_note == ""
    assert found.feasible, found.quality.violated
    assert found.quality.cost_mm2 <= found.start_quality.cost_mm2
