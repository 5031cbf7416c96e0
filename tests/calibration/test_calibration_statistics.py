"""Statistics tested as statistics: intervals, covariance, bounds, power, false alarms.

Limits follow from the small numbers; ``python -m benchmarks.calibration`` and ``benchmarks.drift``
measure the same with a thousand trials.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest

from benchmarks.draws import Draws, draw
from benchmarks.trials import (
    Bench,
    Disturb,
    bent,
    camera_shifted,
    camera_turned,
    cameras_swapped,
    focus,
    ids_swapped,
    late,
    nothing,
    printed,
    run,
    target_moved,
    two_cameras,
)

pytestmark = pytest.mark.slow

SIGMA_PX = 0.05
CHECK_SIGMA_PX = 0.1


@pytest.fixture(scope="module")
def few() -> Draws:
    return draw(40, SIGMA_PX, frames=6, rings=40)


def test_stated_intervals_hold_the_truth(few: Draws) -> None:
    # 40 draws of some 90 parameters, of which about 30 are independent: 1200 cases scatter by
    # 0.6 %, and four of those are allowed.
    assert few.coverage.mean() == pytest.approx(0.95, abs=0.025)


def test_whitened_errors_are_normal(few: Draws) -> None:
    scale = np.sqrt(np.diag(few.predicted))
    sizes, axes = np.linalg.eigh(few.predicted / np.outer(scale, scale))
    good = sizes > 1e-9
    white = (few.error / scale) @ axes[:, good] / np.sqrt(sizes[good])
    assert kstest(white.ravel(), "norm").pvalue > 1e-3
    # A mean square of 40 x 85 normal numbers: 1 +- 0.024, and four of those.
    assert np.mean(white**2) == pytest.approx(1.0, abs=0.1)


def test_centres_reach_the_cramer_rao_bound(few: Draws) -> None:
    # Six degrees of freedom carry most of the centres' errors: 240 squares scatter by 9 %, their
    # root by 4.6 %; four of those.
    assert 0.8 < few.centre_ratio < 1.2


def test_lengths_are_near_those_of_true_cameras(few: Draws) -> None:
    ratio = np.sqrt(np.mean(few.length_um**2) / np.mean(few.floor_um**2))
    assert ratio < 1.35


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench.of(CHECK_SIGMA_PX)


ROWS: dict[str, Disturb] = {
    "turned": camera_turned(10.0),
    "shifted": camera_shifted(20.0),
    "two": two_cameras(10.0, 20.0),
    "focus": focus(1e-3),
    "bent": bent(0.1),
    "ids": ids_swapped,
    "print": printed(0.97),
    "late": late(2.0, 100.0),
    "swapped": cameras_swapped,
    "knocked": target_moved(100.0),
}


@pytest.mark.parametrize("name", ROWS)
def test_each_disturbance_gets_its_verdict(bench: Bench, name: str) -> None:
    found = run(bench, ROWS[name], 5, 1)
    # At 95 % two misses of five have a chance of 2 %, three of 0.1 %.
    assert found.named >= 3


def test_an_unchanged_rig_is_fine(bench: Bench) -> None:
    # At 0.1 % a single false alarm in 40 checks has a chance of 4 %; two have one of 0.08 %.
    assert run(bench, nothing, 40, 2).alarmed <= 1


def test_the_trials_have_teeth(bench: Bench) -> None:
    """A movement far below what can be seen is not reported: the power above is the test's."""
    found = run(bench, camera_turned(0.3), 10, 5)
    assert found.alarmed <= 1
