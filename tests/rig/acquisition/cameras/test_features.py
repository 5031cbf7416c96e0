"""Features by name, on cameras of both generations of names."""

from __future__ import annotations

import time
from collections.abc import Sequence

import pytest

from common.errors import InputError
from rig.acquisition.cameras.workers import features


class Register:
    """A camera's features in memory: what the real libraries are in the backends' own tests."""

    def __init__(self, **values: features.Value) -> None:
        self.values = dict(values)
        self.limits: dict[str, tuple[float, float]] = {}
        self.entries: dict[str, list[str]] = {}
        self.done: list[str] = []
        self.clock = ""

    def has(self, name: str) -> bool:
        return name in self.values

    def get(self, name: str) -> features.Value:
        return self.values[name]

    def set(self, name: str, value: features.Value) -> None:
        assert name in self.values
        self.values[name] = value
        self.done.append(name)

    def run(self, name: str) -> None:
        self.done.append(name)
        if self.clock:
            self.values[self.clock] = 5_000_000

    def bounds(self, name: str) -> tuple[float, float] | None:
        return self.limits.get(name)

    def choices(self, name: str) -> Sequence[str]:
        return self.entries.get(name, [])


@pytest.mark.parametrize("name", ["ExposureTime", "ExposureTimeAbs"])
def test_exposure_is_set_by_its_new_or_old_name_after_the_automatic_is_off(name: str) -> None:
    camera = Register(**{name: 100.0, "ExposureAuto": "Continuous"})
    camera.entries["ExposureAuto"] = ["Off", "Continuous"]
    camera.limits[name] = (10.0, 1000.0)
    assert features.configure(camera, {"exposure_us": 500.0})["exposure_us"] == 500.0
    assert camera.done == ["ExposureAuto", name]
    with pytest.raises(InputError, match=r"choose from 10 to 1000"):
        features.configure(camera, {"exposure_us": 1001.0})
    assert camera.values[name] == 500.0


def test_a_gain_in_steps_of_the_maker_is_not_decibels() -> None:
    assert "gain_db" not in features.settable(Register(GainRaw=3))
    assert "gain_db" in features.settable(Register(Gain=3.0))
    with pytest.raises(InputError, match=r"gain_db"):
        features.configure(Register(GainRaw=3), {"gain_db": 1.0})


@pytest.mark.parametrize("field", ["iso", "f_number"])
def test_what_bodies_have_industrial_cameras_have_not(field: str) -> None:
    with pytest.raises(InputError, match=field):
        features.configure(Register(), {field: 1.0})


def triggered() -> Register:
    camera = Register(
        TriggerMode="Off", TriggerSource="", TriggerSelector="", TriggerActivation="FallingEdge"
    )
    camera.entries["TriggerSource"] = ["Line1", "Line2", "Software"]
    camera.entries["TriggerSelector"] = ["FrameStart", "FrameBurstStart"]
    return camera


def test_a_line_triggers_by_its_rising_edge_at_each_frame() -> None:
    camera = triggered()
    assert features.set_trigger(camera, "edge", "Line2") == "edge"
    assert camera.values == {
        "TriggerMode": "On",
        "TriggerSource": "Line2",
        "TriggerSelector": "FrameStart",
        "TriggerActivation": "RisingEdge",
    }
    # The mode comes last: a camera that is switched on half set up may fire on any noise.
    assert camera.done[-1] == "TriggerMode"


def test_a_line_that_is_not_there_is_named_with_those_that_are() -> None:
    camera = triggered()
    with pytest.raises(InputError, match=r"'Line0'.*Line1, Line2, Software"):
        features.set_trigger(camera, "edge", "Line0")
    assert camera.values["TriggerMode"] == "Off"


def test_triggering_by_software_and_not_at_all() -> None:
    camera = triggered()
    assert features.set_trigger(camera, "software", "Line1") == "software"
    assert camera.values["TriggerSource"] == "Software"
    assert features.set_trigger(camera, "none", "Line1") == "none"
    assert camera.values["TriggerMode"] == "Off"
    assert features.set_trigger(Register(), "edge", "Line1") == "none"


def test_the_latch_reads_nanoseconds_from_new_names() -> None:
    camera = Register(TimestampLatch=0, TimestampLatchValue=0)
    camera.clock = "TimestampLatchValue"
    began = time.monotonic_ns()
    reading = features.latch(camera)
    assert reading is not None
    assert began <= reading[0] <= reading[2] <= time.monotonic_ns()
    assert reading[1] == 5_000_000


def test_the_latch_scales_ticks_of_old_names() -> None:
    camera = Register(
        GevTimestampControlLatch=0, GevTimestampValue=0, GevTimestampTickFrequency=125_000_000
    )
    camera.clock = "GevTimestampValue"
    reading = features.latch(camera)
    assert reading is not None
    assert reading[1] == 40_000_000  # 5 000 000 ticks of 8 ns


def test_a_clock_that_stands_at_zero_is_none() -> None:
    assert features.latch(Register()) is None
    assert features.latch(Register(TimestampLatch=0, TimestampLatchValue=0)) is None


@pytest.mark.parametrize(
    ("switch", "status"), [("PtpEnable", "PtpStatus"), ("GevIEEE1588", "GevIEEE1588Status")]
)
def test_ptp_counts_only_when_it_is_locked(switch: str, status: str) -> None:
    camera = Register(**{switch: 0, status: "Listening"})
    features.enable_ptp(camera)
    assert camera.values[switch] == 1
    assert not features.await_ptp(camera, 0.0)
    camera.values[status] = "Slave"
    assert features.await_ptp(camera, 0.0)
    assert not features.await_ptp(Register(), 0.0)


def test_the_rate_of_a_free_camera_is_unlocked_and_set() -> None:
    camera = Register(AcquisitionFrameRate=1.0, AcquisitionFrameRateEnable=0)
    features.set_rate(camera, None)
    assert camera.done == []
    features.set_rate(camera, 50.0)
    assert camera.values == {"AcquisitionFrameRate": 50.0, "AcquisitionFrameRateEnable": 1}


def test_the_delay_from_edge_to_exposure_is_told_where_known() -> None:
    assert features.exposure_delay_us(Register()) is None
    assert features.exposure_delay_us(Register(BslExposureStartDelay=17.5)) == 17.5
