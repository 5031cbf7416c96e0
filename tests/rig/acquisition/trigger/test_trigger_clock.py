"""The clock model: how far off it is, whether it knows that, and what cannot move it."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.acquisition.cameras.base import ClockSample
from rig.acquisition.synchrony.clocks import fit_clock
from rig.acquisition.trigger.clock import MAX_SAMPLES, WINDOW_S, ClockFit, ClockModel

HOST0 = 5_000_000_000_000
WIRE_NS = 46 * 10 * 1e9 / 115_200


def device_ns(host_ns: float, drift_ppm: float) -> int:
    """A clock of 0.5 us ticks that started some time before HOST0."""
    return int((host_ns - HOST0 + 9e9) * (1.0 + drift_ppm * 1e-6) / 500.0) * 500


def reading(
    at_s: float, drift_ppm: float, there_s: float, back_s: float, wire_ns: float = 0.0
) -> ClockSample:
    before = HOST0 + int(at_s * 1e9)
    heard = before + there_s * 1e9 + wire_ns
    return ClockSample(before, device_ns(heard, drift_ppm), int(heard + back_s * 1e9 + wire_ns))


def model_of(
    seed: int, drift_ppm: float, latency_s: tuple[float, float], wire_ns: float = WIRE_NS
) -> tuple[ClockModel, float]:
    """The driver's plan of sampling: quickly until it is full, then twice a second."""
    chance = random.Random(seed)  # noqa: S311 - delays of a test
    model = ClockModel(wire_ns)
    at_s = 0.0
    for number in range(260):
        there, back = (chance.uniform(0.0, limit) for limit in latency_s)
        model.add(reading(at_s, drift_ppm, there, back, wire_ns))
        at_s += 0.1 if number < 200 else 0.5
    return model, at_s


def error_us(fit: ClockFit, at_s: float, drift_ppm: float) -> float:
    at = HOST0 + int(at_s * 1e9)
    return (fit.host_ns(device_ns(at, drift_ppm)) - at) / 1000.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("latency_s", "p99_us"),
    [
        ((0.0005, 0.0005), 100.0),  # a quick adapter: the goal without added latency
        ((0.0002, 0.016), 500.0),  # FTDI's timer holds answers back by up to 16 ms
        ((0.0, 0.016), 500.0),
    ],
)
def test_pulse_times_are_right_at_the_worst_place(
    latency_s: tuple[float, float], p99_us: float
) -> None:
    errors = []
    for seed in range(150):
        drift_ppm = random.Random(seed).uniform(-5000.0, 5000.0)  # noqa: S311
        model, end_s = model_of(seed, drift_ppm, latency_s)
        fit = model.fit()
        assert fit is not None
        pulse_s = end_s - 1.0  # near the newest readings, where a line is known worst
        errors.append(abs(error_us(fit, pulse_s, drift_ppm)))
        assert errors[-1] <= fit.uncertainty_us(device_ns(HOST0 + pulse_s * 1e9, drift_ppm)) + 1.0
        assert abs(fit.drift_ppm - drift_ppm) < 100.0
    assert np.percentile(errors, 99) <= p99_us
    assert np.median(errors) <= p99_us / 4.0


@settings(deadline=None, max_examples=60, derandomize=True)
@given(
    st.integers(0, 10_000),
    st.floats(-5000.0, 5000.0),
    st.floats(0.0, 0.02),
    st.floats(0.0, 0.02),
    st.integers(2, 40),
)
def test_the_stated_uncertainty_holds_whatever_the_delays(
    seed: int, drift_ppm: float, there_s: float, back_s: float, count: int
) -> None:
    chance = random.Random(seed)  # noqa: S311 - delays of a test
    model = ClockModel()
    times = sorted(chance.uniform(0.0, 30.0) for _ in range(count))
    for at_s in times:
        there, back = chance.uniform(0.0, there_s), chance.uniform(0.0, back_s)
        model.add(reading(at_s, drift_ppm, there, back))
    fit = model.fit()
    assert fit is not None
    assert model.dropped == 0
    pulse_s = chance.uniform(times[0], times[-1])
    at = device_ns(HOST0 + pulse_s * 1e9, drift_ppm)
    # 1 us beyond: a tick of 0.5 us, and rounding to nanoseconds on the way.
    assert abs(error_us(fit, pulse_s, drift_ppm)) <= fit.uncertainty_us(at) + 1.0


def test_one_slow_reading_does_not_move_the_line() -> None:
    model, end_s = model_of(1, 200.0, (0.0002, 0.0002))
    first = model.fit()
    model.add(reading(end_s, 200.0, 0.0001, 3.0, WIRE_NS))
    second = model.fit()
    assert first is not None
    assert second is not None
    assert abs(error_us(second, end_s, 200.0) - error_us(first, end_s, 200.0)) < 20.0


def test_both_directions_of_conversion_agree() -> None:
    fit = model_of(3, 1234.0, (0.001, 0.001))[0].fit()
    assert fit is not None
    for host in (HOST0, HOST0 + 10**10, HOST0 - 10**9):
        assert abs(fit.host_ns(fit.device_ns(host)) - host) <= 2


def test_a_clock_that_began_anew_is_followed() -> None:
    model, end_s = model_of(4, 100.0, (0.0005, 0.0005))
    for number in range(10):
        late = reading(end_s + number * 0.5, 100.0, 0.0001, 0.0001, WIRE_NS)
        model.add(
            ClockSample(late.host_before_ns, late.device_ns - 20_000_000_000, late.host_after_ns)
        )
    fit = model.fit()
    assert fit is not None
    assert model.dropped >= 200
    assert fit.samples == 10


def test_the_window_is_bounded() -> None:
    model = ClockModel()
    for number in range(1000):
        model.add(reading(number * 1.0, 0.0, 0.001, 0.001))
    assert len(model) <= min(MAX_SAMPLES, WINDOW_S + 1)


@pytest.mark.parametrize("minutes", [1.0, 2.5, 30.0])
def test_a_camera_is_timed_however_long_its_capture_took(minutes: float) -> None:
    end_s = 60.0 * minutes
    early = [reading(0.001 * number, 18.0, 2e-5, 2e-5) for number in range(8)]
    late = [reading(end_s + 0.001 * number, 18.0, 2e-5, 2e-5) for number in range(8)]
    clock = fit_clock(late + early)
    assert clock is not None
    # A fire shortly after arming: between two bounds that are 40 us apart.
    at = device_ns(HOST0 + 0.5e9, 18.0)
    assert clock.uncertainty_us(at) <= 22.0
    assert abs(clock.host_ns(at) - (HOST0 + 0.5e9)) / 1e3 <= 22.0


def test_one_reading_is_no_line() -> None:
    model = ClockModel()
    assert model.fit() is None
    model.add(reading(0.0, 0.0, 0.001, 0.001))
    assert model.fit() is None
    model.add(reading(0.1, 0.0, 0.001, 0.001))
    assert model.fit() is not None
    model.clear()
    assert model.fit() is None


def test_delays_that_are_the_same_both_ways_cost_no_certainty() -> None:
    known = model_of(5, 50.0, (0.0002, 0.0002), WIRE_NS)[0].fit()
    assert known is not None
    at = device_ns(HOST0 + 40e9, 50.0)
    # On the wire for 4 ms each way, and yet known to a fraction of the adapter's 0.2 ms.
    assert known.uncertainty_us(at) < 500.0
