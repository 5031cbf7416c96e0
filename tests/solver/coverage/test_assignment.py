"""Which views are assigned to which cameras, against a plain reading of the rule."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.coverage.assignment import (
    FARTHEST_DEG,
    AssignedViews,
    Margins,
    assign_views,
    required_views,
)
from solver.limits import CoverageTier

TWO = (CoverageTier(2, 1.0),)
NONE_FIXED = np.zeros(3, dtype=np.bool_)


def table(*rows: tuple[float, ...]) -> np.ndarray:
    """Deficits, one row a camera, one column a point."""
    return np.array(rows, dtype=np.float64)


def pairs(assigned: AssignedViews) -> dict[tuple[int, int], bool]:
    keys = zip(assigned.camera.tolist(), assigned.point.tolist(), strict=True)
    return dict(zip(keys, assigned.kept.tolist(), strict=True))


def test_each_point_goes_to_the_cameras_that_see_it_best() -> None:
    deficit = table((-30.0, -5.0), (-10.0, -6.0), (-20.0, -7.0))
    assert pairs(assign_views(TWO, deficit, NONE_FIXED)) == {
        (0, 0): True,
        (2, 0): True,
        (1, 1): True,
        (2, 1): True,
    }


def test_a_view_that_is_missing_goes_to_the_camera_that_comes_nearest() -> None:
    deficit = table((-30.0,), (12.0,), (11.0,))
    assert pairs(assign_views(TWO, deficit, NONE_FIXED)) == {(0, 0): True, (2, 0): False}


@pytest.mark.parametrize(("away", "taken"), [(FARTHEST_DEG - 0.01, True), (FARTHEST_DEG, False)])
def test_a_view_too_far_away_is_not_assigned(away: float, taken: bool) -> None:
    deficit = table((-30.0,), (away,), (np.inf,))
    assert ((1, 0) in pairs(assign_views(TWO, deficit, NONE_FIXED))) is taken


def test_a_deficit_of_zero_counts_as_seen() -> None:
    found = pairs(assign_views(TWO, table((0.0,), (1e-9,), (np.inf,)), NONE_FIXED))
    assert found == {(0, 0): True, (1, 0): False}


def test_fixed_cameras_count_where_they_see_and_are_never_assigned() -> None:
    fixed = np.array([True, False, False])
    seeing = assign_views(TWO, table((-1.0,), (-30.0,), (-20.0,)), fixed)
    assert pairs(seeing) == {(1, 0): True}
    blind = assign_views(TWO, table((5.0,), (-30.0,), (-20.0,)), fixed)
    assert pairs(blind) == {(1, 0): True, (2, 0): True}


def test_an_assignment_that_was_kept_stays_where_it_is_nearly_as_good() -> None:
    one = (CoverageTier(1, 1.0),)
    earlier = AssignedViews(np.array([0]), np.array([0]), np.array([True]))
    nearly = table((-11.0,), (-20.0,), (-15.0,))
    assert pairs(assign_views(one, nearly, NONE_FIXED, earlier=earlier)) == {(0, 0): True}
    much_worse = table((-9.0,), (-20.0,), (-15.0,))
    assert pairs(assign_views(one, much_worse, NONE_FIXED, earlier=earlier)) == {(1, 0): True}


def test_loyalty_ends_exactly_at_ten_degrees() -> None:
    one = (CoverageTier(1, 1.0),)
    earlier = AssignedViews(np.array([1]), np.array([0]), np.array([True]))
    # On a tie the first camera is taken: loyalty of 10 makes -10 the equal of -20.
    assert pairs(
        assign_views(one, table((-20.0,), (-10.0,), (np.inf,)), NONE_FIXED, earlier=earlier)
    ) == {(0, 0): True}
    assert pairs(
        assign_views(one, table((-20.0,), (-10.1,), (np.inf,)), NONE_FIXED, earlier=earlier)
    ) == {(1, 0): True}


def test_an_assignment_that_was_broken_goes_to_another_camera_nearly_as_near() -> None:
    one = (CoverageTier(1, 1.0),)
    earlier = AssignedViews(np.array([0]), np.array([0]), np.array([False]))
    near = table((2.0,), (11.0,), (np.inf,))
    assert pairs(assign_views(one, near, NONE_FIXED, earlier=earlier)) == {(1, 0): False}
    far = table((2.0,), (13.0,), (np.inf,))
    assert pairs(assign_views(one, far, NONE_FIXED, earlier=earlier)) == {(0, 0): False}


def test_loyalty_does_not_change_what_was_handed_in() -> None:
    deficit = table((-11.0,), (-20.0,), (-15.0,))
    before = deficit.copy()
    earlier = AssignedViews(np.array([0]), np.array([0]), np.array([True]))
    assign_views(TWO, deficit, NONE_FIXED, earlier=earlier)
    np.testing.assert_array_equal(deficit, before)


def test_the_share_of_a_tier_goes_to_the_easiest_points() -> None:
    deficit = np.stack([np.full(10, -50.0), np.arange(10.0)])
    views = required_views((CoverageTier(1, 1.0), CoverageTier(2, 0.35)), deficit, 0.0)
    np.testing.assert_array_equal(views, [2, 2, 2, 2, 1, 1, 1, 1, 1, 1])


def test_spare_is_added_to_each_share_and_stops_at_all() -> None:
    deficit = np.stack([np.arange(10.0)])
    half = (CoverageTier(1, 0.5),)
    assert required_views(half, deficit, 0.0).sum() == 5
    assert required_views(half, deficit, 0.15).sum() == 7
    assert required_views(half, deficit, 0.9).sum() == 10


def test_more_views_than_cameras_are_asked_of_all_cameras() -> None:
    assert required_views((CoverageTier(5, 1.0),), np.zeros((3, 2)), 0.0).tolist() == [3, 3]


def test_the_order_of_tiers_does_not_matter() -> None:
    deficit = np.random.default_rng(2).normal(size=(4, 30))
    tiers = (CoverageTier(3, 0.5), CoverageTier(1, 1.0), CoverageTier(2, 0.8))
    np.testing.assert_array_equal(
        required_views(tiers, deficit, 0.01), required_views(tiers[::-1], deficit, 0.01)
    )


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.integers(1, 5), st.integers(1, 4), st.floats(0.1, 1.0))
def test_assigned_views_follow_the_rule(seed: int, n: int, views: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    deficit = rng.normal(scale=25.0, size=(n, 12))
    fixed = rng.random(n) < 0.3
    tiers = (CoverageTier(views, share),)
    required = required_views(tiers, deficit, 0.0)
    expected = {}
    for p in range(12):
        seen_by_fixed = [i for i in range(n) if fixed[i] and deficit[i, p] <= 0.0]
        others = sorted((i for i in range(n) if not fixed[i]), key=lambda i: deficit[i, p])
        left = max(0, required[p] - len(seen_by_fixed))
        for i in others[:left]:
            if deficit[i, p] < FARTHEST_DEG:
                expected[i, p] = bool(deficit[i, p] <= 0.0)
    assert pairs(assign_views(tiers, deficit, fixed)) == expected


def test_margins_grow_by_the_shortfall_and_by_a_degree() -> None:
    wider = Margins().wider(0.01)
    assert wider.share == pytest.approx(0.01 + 0.015 + 0.002)
    assert wider.angle_deg == 1.0
    assert wider.wider(0.0).angle_deg == 2.0


def test_margins_end_somewhere() -> None:
    margins = Margins()
    for _ in range(30):
        margins = margins.wider(0.1)
    assert margins == Margins(0.2, 8.0)
