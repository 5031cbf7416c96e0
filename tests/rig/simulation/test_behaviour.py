"""Faults and clocks of simulated cameras, drawn from seeds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import InputError
from rig.simulation.behaviour import CameraClock, camera_key, draw
from rig.simulation.faults import CameraFaults

SEED = (7, camera_key("cam01"))


def test_lags_have_the_mean_the_jitter_and_the_drift_asked_for() -> None:
    faults = CameraFaults(lag_mean_us=5000.0, lag_jitter_us=200.0, lag_drift_us_per_shot=3.0)
    count = 2000
    lags = np.array([draw(faults, SEED, n).lag_us for n in range(1, count + 1)])
    fit = np.polyfit(np.arange(count), lags, 1)
    # Errors of a line through N points: 2 sigma / sqrt(N) at its start, sqrt(12 / N^3) sigma.
    assert fit[1] == pytest.approx(5000.0, abs=4.0 * 2.0 * 200.0 / np.sqrt(count))
    assert fit[0] == pytest.approx(3.0, abs=4.0 * 200.0 * np.sqrt(12.0 / count**3))
    rest = lags - np.polyval(fit, np.arange(count))
    assert rest.std() == pytest.approx(200.0, rel=4.0 / np.sqrt(2.0 * count))


def test_lags_are_never_negative() -> None:
    faults = CameraFaults(lag_mean_us=1.0, lag_jitter_us=100.0)
    assert min(draw(faults, SEED, n).lag_us for n in range(1, 50)) == 0.0


def test_chances_come_true_as_often_as_asked() -> None:
    faults = CameraFaults(drop=0.1, black=0.5)
    drawn = [draw(faults, SEED, n).faults for n in range(1, 2001)]
    for name, chance in (("drop", 0.1), ("black", 0.5), ("late", 0.0)):
        share = np.mean([name in found for found in drawn])
        assert share == pytest.approx(chance, abs=4.0 * np.sqrt(chance * (1 - chance) / 2000))


def test_a_fault_switched_on_leaves_the_others_as_they_were() -> None:
    before = CameraFaults(lag_jitter_us=50.0, lag_mean_us=500.0, black=0.3)
    after = replace(before, drop=0.5)
    for number in range(1, 40):
        first, second = draw(before, SEED, number), draw(after, SEED, number)
        assert first.lag_us == second.lag_us
        assert first.faults == second.faults - {"drop"}


def test_faults_can_be_kept_to_given_shots() -> None:
    faults = CameraFaults(drop=1.0, only_shots=(2, 5))
    hit = [n for n in range(1, 10) if "drop" in draw(faults, SEED, n).faults]
    assert hit == [2, 5]


@pytest.mark.parametrize(
    "changes",
    [
        {"drop": 1.5},
        {"lag_jitter_us": -1.0},
        {"lag_mean_us": float("nan")},
        {"free_run_interval_ms": 0.0},
        {"unplug_at_shot": 0},
        {"only_shots": (0,)},
    ],
)
def test_impossible_faults_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(InputError) as caught:
        CameraFaults(**changes)
    assert caught.value.code == "input/camera-faults"


@given(st.integers(0, 10**16), st.integers(0, 10**13), st.floats(-500.0, 500.0))
def test_clocks_run_forward_at_their_rate(start: int, passed: int, ppm: float) -> None:
    clock = CameraClock(start, 12345, ppm)
    shown = clock.at(start + passed) - clock.at(start)
    assert abs(shown - passed * (1.0 + ppm * 1e-6)) <= 1.0 + passed * 1e-12
    assert clock.at(start) == 12345
    assert clock.reset_at(start + passed).at(start + passed) == 0


def test_clocks_differ_from_camera_to_camera_and_repeat_for_a_seed() -> None:
    first = CameraClock.drawn(SEED, 1000, 20.0)
    assert first == CameraClock.drawn(SEED, 1000, 20.0)
    assert first.zero_ns != CameraClock.drawn((7, camera_key("cam02")), 1000, 20.0).zero_ns
    assert abs(first.drift_ppm) <= 20.0
