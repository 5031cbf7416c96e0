"""The time of an exposure from the shares of a Gray-coded counter's bits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.acquisition.timingboard.graytime import lit_shares, solve_interval

BITS = 16


def difference(found: float, true: float) -> float:
    """Around the counter's range."""
    half = 2.0 ** (BITS - 1)
    return (found - true + half) % (2.0 * half) - half


@given(
    st.integers(4, 10),
    st.floats(0.0, 1023.0, allow_nan=False),
    st.floats(0.03125, 40.0, allow_nan=False),
)
def test_shares_are_those_of_the_counter_itself(bits: int, start: float, length: float) -> None:
    edges = np.unique(
        np.clip(np.arange(np.floor(start), start + length + 1), start, start + length)
    )
    counts = np.floor((edges[1:] + edges[:-1]) / 2.0).astype(int) % 2**bits
    gray = counts ^ (counts >> 1)
    lit = ((gray[:, None] >> np.arange(bits)) & 1) * np.diff(edges)[:, None]
    found = lit_shares(np.array(start + length / 2.0), np.array(length), bits)
    assert np.abs(found - lit.sum(axis=0) / length).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("length", [0.1, 0.7, 2.3, 10.0, 40.0, 250.0])
@pytest.mark.parametrize("known", [False, True])
def test_errors_are_as_large_as_stated(length: float, known: bool) -> None:
    """25 random instants each: the errors are distributed as the standard deviations say."""
    rng = np.random.default_rng(int(10 * length))
    scaled = []
    for _ in range(25):
        middle, sigma = rng.uniform(0.0, 2.0**BITS), np.full(BITS, 0.005)
        shares = lit_shares(np.array(middle), np.array(length), BITS) + rng.normal(0.0, sigma)
        found = solve_interval(shares, sigma, 1.04 * length if known else None)
        scaled.append(difference(found.middle_ticks, middle) / found.middle_sigma_ticks)
    # The rms of 25 unit normals is 1 +- 0.14; a stated exposure believed to 10 % may give less.
    assert np.sqrt(np.mean(np.square(scaled))) < 1.5
    assert np.abs(scaled).max() < 5.0


@pytest.mark.parametrize("length", [3.7, 10.0, 40.0, 80.0])
def test_exact_shares_give_the_exact_time(length: float) -> None:
    rng = np.random.default_rng(4)
    for middle in rng.uniform(0.0, 2.0**BITS, 15):
        shares = lit_shares(np.array(middle), np.array(length), BITS)
        found = solve_interval(shares, np.full(BITS, 1e-3))
        assert abs(difference(found.middle_ticks, middle)) < 0.06 + 0.0005 * length
        assert found.residual < 5e-3


def test_the_counter_goes_round_within_an_exposure() -> None:
    shares = lit_shares(np.array(0.5), np.array(20.0), BITS)
    found = solve_interval(shares, np.full(BITS, 2e-3))
    assert abs(difference(found.middle_ticks, 0.5)) < 0.1
    assert found.length_ticks == pytest.approx(20.0, abs=0.3)


def test_an_exposure_stated_far_beyond_the_counters_range_is_not_believed() -> None:
    shares = lit_shares(np.array(1000.0), np.array(12.0), BITS)
    found = solve_interval(shares, np.full(BITS, 2e-3), 1e7)
    assert found.length_ticks == pytest.approx(12.0, abs=0.3)
