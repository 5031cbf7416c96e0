"""Grain belongs to the surface: same for all cameras, faded where a pixel is wider than it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.simulation.grain import SPACINGS_MM, grain, value_noise

CONTRAST = 0.06


def points(count: int = 60_000, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-120.0, 120.0, (count, 3)).astype(np.float32)


def rms_at(footprint_mm: float) -> float:
    places = points()
    found = grain(places, np.full(len(places), footprint_mm, np.float32), CONTRAST, 0)
    assert found.mean() == pytest.approx(1.0, abs=5.0 * CONTRAST / np.sqrt(len(places)))
    return float(found.std())


def test_the_contrast_is_the_one_asked_for_where_pixels_are_fine() -> None:
    assert rms_at(0.02) == pytest.approx(CONTRAST, rel=0.02)


def test_lattices_finer_than_a_pixel_fade_out() -> None:
    # At 0.24 mm the finest of three lattices is gone: two thirds of the variance are left, the
    # middle one at full strength (0.35 / 0.24 - 0.5 = 0.96).
    assert rms_at(0.24) == pytest.approx(CONTRAST * np.sqrt((0.96**2 + 1.0) / 3.0), rel=0.02)
    assert rms_at(2.0 * SPACINGS_MM[-1]) == 0.0


@given(st.integers(-(2**20), 2**20), st.integers(0, 2**32 - 1))
def test_noise_is_the_nodes_number_at_a_node_and_continuous(node: int, salt: int) -> None:
    at = np.array([[node, -node, 3]], dtype=np.float32)
    near = at + np.float32(0.125)
    here, beside = value_noise(at, np.uint32(salt)), value_noise(near, np.uint32(salt))
    assert -1.0 <= here[0] <= 1.0
    # Smoothstep rises by at most 1.5 per unit and axis, over a range of 2.
    assert abs(here[0] - beside[0]) <= 3 * 1.5 * 2.0 * 0.125


def test_nodes_are_independent() -> None:
    grid = np.mgrid[-20:20, -20:20, -20:20].reshape(3, -1).T.astype(np.float32)
    cube = value_noise(grid, np.uint32(5)).reshape(40, 40, 40)
    for axis in range(3):
        first, second = np.take(cube, range(39), axis), np.take(cube, range(1, 40), axis)
        # 62,400 pairs: a correlation of 0 is found to 0.004.
        assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.02


def test_another_seed_is_another_skin() -> None:
    places = points(20_000)
    fine = np.full(len(places), 0.05, np.float32)
    first, second = (grain(places, fine, CONTRAST, seed) for seed in (1, 2))
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.05
    assert np.array_equal(first, grain(places, fine, CONTRAST, 1))
