"""The limits to first order, and the least move that meets them, against a general solver."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mounted import row
from scipy.optimize import minimize

from rig.build.mounts.linear import CENTRED, HARD, STEP_SCALE_MM, LinearLimits, LinearModel
from solver.result import Sense


def limits(jacobian: np.ndarray, slack: np.ndarray, most: np.ndarray | None = None) -> LinearLimits:
    count = len(slack)
    return LinearLimits(
        tuple(f"row{k}" for k in range(count)),
        jacobian,
        slack,
        np.ones(count),
        np.zeros(count),
        np.full(count, np.inf) if most is None else most,
    )


def price(move: np.ndarray, jacobian: np.ndarray, lack: np.ndarray) -> float:
    """The objective as it is written down."""
    left = np.maximum(0.0, lack - jacobian @ move)
    return float(((move / STEP_SCALE_MM) ** 2).sum() + HARD**2 * (left**2).sum())


@settings(deadline=None, max_examples=30)
@example(8, 4, 8)  # whole Newton steps went round in a circle
@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(1, 8))
def test_no_other_move_is_cheaper(seed: int, slides: int, rows: int) -> None:
    rng = np.random.default_rng(seed)
    jacobian, slack = rng.normal(size=(rows, slides)), rng.normal(size=rows)
    move = limits(jacobian, slack).least_move({})
    cost = price(move, jacobian, -slack)
    # Convex: a general minimiser started there and at zero may gain rounding only.
    for start in (move, np.zeros(slides)):
        other = minimize(price, start, (jacobian, -slack), method="BFGS")
        assert cost <= other.fun * (1.0 + 1e-6) + 1e-9
    step = 1e-5
    for axis in np.eye(slides):
        assert price(move + step * axis, jacobian, -slack) >= cost - 1e-9 * (1.0 + cost)
        assert price(move - step * axis, jacobian, -slack) >= cost - 1e-9 * (1.0 + cost)


def test_nothing_moves_where_nothing_lacks() -> None:
    rng = np.random.default_rng(1)
    assert not limits(rng.normal(size=(5, 3)), np.full(5, 0.5)).least_move({}).any()
    # A margin that the slack just covers is none that lacks.
    assert not limits(np.eye(3), np.full(3, 0.5)).least_move({"row0": 0.5}).any()


def test_a_margin_is_gained_although_the_limit_holds() -> None:
    move = limits(np.array([[2.0, 0.0]]), np.array([0.5])).least_move({"row0": 1.5})
    # 1 of slack at 2 per mm; the weight against moving leaves 1 / (1 + (3 * 300 * 2)^2).
    assert move == pytest.approx([0.5, 0.0], rel=1e-6)
    assert not limits(np.array([[2.0, 0.0]]), np.array([0.5])).least_move({"other": 9.0}).any()


def test_the_far_side_of_a_tolerance_counts() -> None:
    """Slack 1.9 of a tolerance of 2 with 1 as margin: the other side is as far away."""
    both = limits(np.array([[1.0]]), np.array([0.3]), np.array([2.0]))
    assert both.least_move({"row0": 1.0}) == pytest.approx([0.7], rel=1e-4)
    beyond = limits(np.array([[1.0]]), np.array([3.7]), np.array([2.0]))
    assert beyond.least_move({"row0": 1.0}) == pytest.approx([-0.7], rel=1e-4)


def test_size_makes_rows_comparable() -> None:
    """Two rows pull apart; the one whose limit is ten times as large may lack ten times as much."""
    pull = LinearLimits(
        ("a", "b"),
        np.array([[1.0], [-1.0]]),
        np.array([-1.1, -1.1]),
        np.array([10.0, 1.0]),
        np.zeros(2),
        np.full(2, np.inf),
    )
    (move,) = pull.least_move({})
    # Minimum of ((1.1 - m) / 10)^2 + (1.1 + m)^2: m = -1.1 * 0.99 / 1.01.
    assert move == pytest.approx(-1.1 * 0.99 / 1.01, rel=1e-3)


def test_margins_are_the_share_of_the_spread_within_a_tolerance() -> None:
    rows = LinearLimits(
        ("open", "closed"),
        np.zeros((2, 1)),
        np.zeros(2),
        np.ones(2),
        np.array([3.0, 3.0]),
        np.array([np.inf, 2.0]),
    )
    assert rows.margins(0.5) == {"open": 1.5, "closed": 1.5}
    assert rows.margins(1.0) == {"open": 3.0, "closed": CENTRED * 2.0}
    assert rows.margins(0.0) == {"open": 0.0, "closed": 0.0}


def test_a_model_gathers_slopes_by_slide_and_row() -> None:
    model = LinearModel()
    here = {"a": row("a", 1.0), "b": row("b", 2.0, limit=-40.0)}
    model.rows(here)
    model.move(here, {"a": row("a", 2.0), "b": row("b", 2.0), "new": row("new", 1.0)}, 0.5)
    model.move(here, {"b": row("b", 1.0)}, -0.25)
    made = model.made()
    assert made.names == ("a", "b")
    assert made.jacobian.tolist() == [[2.0, 0.0], [0.0, 4.0]]
    assert made.slack.tolist() == [1.0, 2.0]
    assert made.size.tolist() == [10.0, 40.0]
    assert made.most.tolist() == [np.inf, np.inf]


def test_rows_told_first_stay() -> None:
    model = LinearModel()
    model.rows({"a": row("a", 1.0)})
    model.rows({"a": row("a", 9.0), "b": row("b", 3.0)})
    made = model.made()
    assert dict(zip(made.names, made.slack.tolist(), strict=True)) == {"a": 1.0, "b": 3.0}


def test_spread_is_the_sum_of_effects_or_the_deviation_of_many() -> None:
    here = {"a": row("a", 5.0)}
    few, many = LinearModel(), LinearModel()
    few.rows(here)
    many.rows(here)
    for count, model in ((1, few), (30, many)):
        for k in range(count):
            # Half a step of 0.5 at a slope of -2 or +2 per unit: 1 of slack, whichever way.
            model.error(here, {"a": row("a", 5.0 + (-1.0) ** k * 0.2)}, 0.1, 0.5)
    assert few.made().spread == pytest.approx([1.0])
    # 2.5 deviations of the sum of 30 uniform errors of +-1: each has a variance of 1/3.
    assert many.made().spread == pytest.approx([2.5 * np.sqrt(30.0 / 3.0)])


def test_the_tolerance_of_an_equality_bounds_its_slack() -> None:
    model = LinearModel()
    model.rows({"even": row("even", 0.5, limit=0.0, sense=Sense.EQUAL), "a": row("a", 1.0)})
    made = model.made()
    assert made.most.tolist() == [2.0, np.inf]
    assert made.size.tolist() == [2.0, 10.0]
