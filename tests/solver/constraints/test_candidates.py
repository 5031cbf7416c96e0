"""Which rows a step works on, against a plain reading of the rule."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.constraints.candidates import VIOLATED, CandidateConstraints, grouped
from solver.constraints.positions import PositionCoordinate
from solver.variables import Unknowns

NONE = np.zeros(0, dtype=np.int64)
ORIGIN = Unknowns(np.eye(3)[None], np.zeros(3), 1.0, np.arange(7)).state(np.zeros(7))


def rows_with(slack: np.ndarray, group: np.ndarray, keep: int) -> CandidateConstraints:
    """Rows of a camera at the origin that have the given slack there."""
    m = len(slack)
    block = PositionCoordinate(
        "t", "", 1.0, -slack, np.full(m, np.inf), np.zeros(m, int), np.zeros(m, int), np.zeros(m)
    )
    return CandidateConstraints(block, group, keep)


def chosen(slack: list[float], group: list[int], keep: int, held=NONE, reach: float = 1.0):  # noqa: ANN001, ANN201
    rows = rows_with(np.array(slack), np.array(group), keep)
    return rows.choose(ORIGIN, np.array(held, dtype=np.int64), reach).tolist()


def test_the_tightest_of_each_group_are_worked_on() -> None:
    assert chosen([0.3, 0.1, 0.2, 0.5, 0.4], [0, 0, 0, 1, 1], 1) == [1, 4]
    assert chosen([0.3, 0.1, 0.2, 0.5, 0.4], [0, 0, 0, 1, 1], 2) == [1, 2, 3, 4]


def test_rows_out_of_reach_are_left_out_unless_held() -> None:
    assert chosen([0.3, 0.9, 2.0], [0, 1, 2], 1, reach=0.5) == [0]
    assert chosen([0.3, 0.9, 2.0], [0, 1, 2], 1, held=[2], reach=0.5) == [0, 2]


def test_violated_rows_join_up_to_four_times_as_many() -> None:
    slack = [-0.1 * k for k in range(1, 8)]
    assert chosen(slack, [0] * 7, 1) == [3, 4, 5, 6]
    assert chosen([-0.5 * VIOLATED, 0.0, -2.0 * VIOLATED], [0] * 3, 1) == [2]


def test_a_block_no_larger_than_what_is_kept_is_whole() -> None:
    assert chosen([9.0, 9.0], [0, 0], 2, reach=0.1) == [0, 1]
    block = rows_with(np.array([9.0, 8.0]), np.zeros(2, int), 1).block
    assert CandidateConstraints.all_of(block).choose(ORIGIN, NONE, 0.0).tolist() == [0, 1]


@settings(max_examples=80, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.integers(1, 4))
def test_the_choice_follows_the_rule(seed: int, keep: int) -> None:
    rng = np.random.default_rng(seed)
    slack, group = rng.normal(scale=0.5, size=15), rng.integers(0, 4, 15)
    held = np.flatnonzero(rng.random(15) < 0.1)
    expected = set(held.tolist())
    for g in range(4):
        mine = sorted(
            (k for k in range(15) if group[k] == g and slack[k] < 0.4), key=lambda k: slack[k]
        )
        for rank, k in enumerate(mine):
            if rank < keep or (slack[k] < -VIOLATED and rank < 4 * keep):
                expected.add(k)
    assert chosen(slack.tolist(), group.tolist(), keep, held=held, reach=0.4) == sorted(expected)


def test_groups_are_the_distinct_combinations() -> None:
    names = grouped(np.array([0, 0, 1, 1, 0]), np.array([0, 1, 0, 1, 0]))
    assert names[0] == names[4]
    assert len(set(names.tolist())) == 4
