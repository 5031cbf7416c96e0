"""Which lags become delays: those that a camera can have and that stay."""

from __future__ import annotations

from dataclasses import replace

import pytest

from common.errors import InputError
from rig.acquisition.station.spec import CameraPlan, Station, TriggerPlan
from rig.acquisition.synchrony.lags import LagEstimate, _estimate, new_timings, with_new_timings

CAMERA = CameraPlan("cam01", "simulated", "1", 1, expected_lag_us=60_000.0)


def estimate(lag_us: float, drift_us: float = 0.0) -> LagEstimate:
    return LagEstimate("cam01", lag_us, 10.0, 100.0, 5, 4000.0, "optical", drift_us)


def written(lag_us: float, drift_us: float = 0.0) -> None:
    station = Station("s", (CAMERA,), TriggerPlan("rigwright", "fake:"))
    new_timings(station, {"cam01": estimate(lag_us, drift_us)})


@pytest.mark.parametrize("lag_us", [41_000.0, 60_000.0, 79_000.0])
def test_a_lag_that_was_expected_is_made_up_for(lag_us: float) -> None:
    written(lag_us)


@pytest.mark.parametrize("lag_us", [-5000.0, 0.0, 39_000.0, 81_000.0, 401_595.0])
def test_a_lag_that_no_such_camera_has_is_not_written(lag_us: float) -> None:
    with pytest.raises(InputError, match="cam01 seems to expose") as caught:
        written(lag_us)
    assert caught.value.code == "input/lag-impossible"


def test_cameras_on_one_output_get_one_delay() -> None:
    """Lags of 50, 54 and 60 ms, the first two on one output: their middle meets the third."""
    lags_us = {"cam01": 50_000.0, "cam02": 54_000.0, "cam03": 60_000.0}
    cameras = tuple(
        replace(CAMERA, name=name, id=name, output=2 if name == "cam03" else 1) for name in lags_us
    )
    station = Station("s", cameras, TriggerPlan("rigwright", "fake:"))
    estimates = {name: replace(estimate(lag), camera=name) for name, lag in lags_us.items()}
    timings = new_timings(station, estimates)
    assert {name: found.delay_us for name, found in timings.items()} == {
        "cam01": 8000.0,
        "cam02": 8000.0,
        "cam03": 0.0,
    }
    assert {name: found.expected_lag_us for name, found in timings.items()} == lags_us
    with_new_timings(station, timings)


def test_a_lag_that_drifts_is_told_and_not_written() -> None:
    with pytest.raises(InputError, match=r"moved by 3\.00 ms in 5 captures") as caught:
        written(61_000.0, drift_us=3000.0)
    assert caught.value.code == "input/lag-drifting"


@pytest.mark.parametrize(
    ("lags_us", "drifts"),
    [
        ((100.0, 1100.0, 2105.0, 3098.0), True),
        ((100.0, 140.0, 95.0, 120.0, 130.0), False),
        ((100.0, 101.0, 102.0, 103.0), False),  # less than a reading is known to
        ((100.0, 3100.0), False),
    ],
)
def test_a_trend_beyond_chance_is_a_drift(lags_us: tuple[float, ...], drifts: bool) -> None:
    figures = [(lag, 50.0, 4000.0) for lag in lags_us]
    assert (_estimate("cam01", figures, "optical").drift_us != 0.0) == drifts


def test_cameras_on_one_focus_line_get_one_delay() -> None:
    """Each has its own output for the shutter, and none for the focus."""
    lags_us = {"cam01": 50_000.0, "cam02": 54_000.0, "cam03": 60_000.0}
    cameras = tuple(
        replace(CAMERA, name=name, id=name, output=k, focus_output=None if k == 3 else 9)
        for k, name in enumerate(lags_us, 1)
    )
    station = Station("s", cameras, TriggerPlan("rigwright", "fake:"))
    estimates = {name: replace(estimate(lag), camera=name) for name, lag in lags_us.items()}
    timings = new_timings(station, estimates)
    assert [found.delay_us for found in timings.values()] == [8000.0, 8000.0, 0.0]
    with_new_timings(station, timings)
