"""Station files: what is read, what is refused, and in which words."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import InputError, TooLargeError
from rig.acquisition.capture.rigfacts import read_rig_design
from rig.acquisition.station.examples import example_station_text
from rig.acquisition.station.pulses import arm_request, station_pulses
from rig.acquisition.station.spec import ImageFormat, Interlock, Station
from rig.acquisition.station.stationfile import parse_station, read_station, station_from_mapping

REPO = Path(__file__).resolve().parents[4]
EXAMPLE = REPO / "examples/station/station.toml"
SMALLEST = """
schema = "rigwright.station/1"
[[camera]]
name = "cam01"
backend = "folder"
id = "left"
"""
FULL = """
schema = "rigwright.station/1"
name = "Bench"
design = "../face/design.json"

[trigger]
url = "/dev/serial/by-id/usb-box"
serial_number = "RW0001"
lead_us = 3000.0
interlock = "required"

[[camera]]
name = "cam01"
backend = "gphoto2"
id = "SN1"
output = 1
focus_output = 2
focus_lead_us = 150000.0
width_us = 200000.0
expected_lag_us = 60000.0
lag_tolerance_us = 5000.0
image_size_px = [6000, 4000]
[camera.settings]
iso = 100
f_number = 11.0

[[camera]]
name = "cam02"
backend = "aravis"
id = "SN2"
output = 3
delay_us = 60000.0

[[strobe]]
output = 13
delay_us = 61000.0

[led]
outputs = [15, 16]
[led.board]
bits = 12

[capture]
skew_limit_us = 300.0
image_format = "png"

[backend.aravis]
packet_size = 9000
"""


def data() -> dict[str, Any]:
    return tomllib.loads(FULL)


def test_the_smallest_station_has_sound_defaults() -> None:
    station = parse_station(SMALLEST)
    assert station.trigger is None and not station.strobes and station.board is None
    assert station.policy.image_format is ImageFormat.JPEG
    assert not station.policy.allow_partial
    assert station.cameras[0].output is None and station.text == SMALLEST


def test_everything_that_can_be_said(tmp_path: Path) -> None:
    path = tmp_path / "station.toml"
    path.write_text(FULL)
    station = read_station(path)
    assert station.path == path and station.design == tmp_path / "../face/design.json"
    assert station.trigger is not None
    assert (station.trigger.backend, station.trigger.serial_number) == ("rigwright", "RW0001")
    assert station.trigger.interlock is Interlock.REQUIRED
    first, second = station.cameras
    assert (first.settings.iso, first.settings.f_number) == (100, 11.0)
    assert first.settings.exposure_us is None and first.image_size_px == (6000, 4000)
    assert second.delay_us == 60_000.0
    assert [light.output for light in station.leds] == [15, 16]
    assert station.board is not None and station.board.bits == 12
    assert station.backend_options == {"aravis": {"packet_size": 9000}}
    assert station.camera("cam02") is second
    with pytest.raises(InputError, match="choose one of cam01, cam02"):
        station.camera("cam03")


def test_the_pulses_of_a_station() -> None:
    """Zero is where the focus line with the longest lead begins."""
    station = parse_station(FULL)
    pulses = station_pulses(station, station.cameras)
    assert station.zero_us == 150_000.0
    figures = {output: (p.delay_us, p.width_us) for output, p in pulses.items()}
    assert figures == {
        1: (150_000.0, 200_000.0),
        2: (0.0, 350_000.0),
        3: (210_000.0, 1000.0),
        13: (211_000.0, 500.0),
        15: (150_000.0, 1000.0),
        16: (150_000.0, 1000.0),
    }
    alone = station_pulses(station, station.cameras[1:])
    assert set(alone) == {3, 13, 15, 16}, "a camera that is not ready gets no pulse"
    request = arm_request(station, station.cameras, "abc", shots=3, interval_us=1e6)
    assert (request.shots, request.interval_us, request.lead_us) == (3, 1e6, 3000.0)


REFUSED = [
    ({"nmae": "x"}, "nmae is not known", "did you mean name"),
    ({"capture": {"jpeg_qualty": 90}}, "capture.jpeg_qualty is not known", "jpeg_quality"),
    ({"capture": {"image_format": "gif"}}, "capture.image_format", "'jpeg', 'png' or 'tiff'"),
    ({"capture": {"frame_deadline_s": 0.0}}, "capture.frame_deadline_s", "greater than 0"),
    ({"trigger": {"url": "x", "backend": "arduino"}}, "trigger.backend", "'rigwright' or 'esper'"),
    (
        {"trigger": {"url": "x", "backend": "esper", "lead_us": 5.0}},
        "trigger",
        "leave lead_us away",
    ),
    ({"trigger": None}, "trigger", ""),
    ({"camera": []}, "camera", "at least 1"),
    ({"schema": "rigwright.rig/1"}, "schema", "rigwright.station/1"),
    ({"led": {"outputs": [15], "board": {"marker_ids": [1]}}}, "led.board.marker_ids", "4"),
]


@pytest.mark.parametrize(("change", "problem", "remedy"), REFUSED)
def test_what_is_wrong_is_named(change: dict[str, Any], problem: str, remedy: str) -> None:
    given_ = {**data(), **change}
    if change == {"trigger": None}:
        del given_["trigger"]
        problem, remedy = "fired by an output, but the station has no trigger", "add [trigger]"
    with pytest.raises(InputError) as error:
        station_from_mapping(given_, "station.toml")
    assert str(error.value).startswith("station.toml")
    assert problem in error.value.problem and remedy in error.value.remedy
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("name", "CAM01", "two cameras are called"),
        ("id", "SN1", "are the same device 'SN1'"),
        ("output", 2, "output 2 is used by the focus of camera 'cam01' and by camera 'cam02'"),
        ("output", 13, "output 13 is used by camera 'cam02' and by strobe 1"),
        ("name", "../cam02", "camera[1].name"),
    ],
)
def test_two_things_cannot_be_one(key: str, value: object, problem: str) -> None:
    given_ = copy.deepcopy(data())
    given_["camera"][1].update({"backend": "gphoto2", key: value})
    with pytest.raises(InputError, match="station") as error:
        station_from_mapping(given_)
    assert problem in str(error.value)


def test_cameras_may_share_an_output_whose_pulse_fits_them_all() -> None:
    given_ = data()
    first = given_["camera"][0]
    given_["camera"] += [{**first, "name": f"cam{k:02d}", "id": f"SN{k}"} for k in range(11, 36)]
    station = station_from_mapping(given_)
    pulses = station_pulses(station, station.cameras)
    assert pulses == station_pulses(station, station.cameras[:2])
    for key in ("delay_us", "width_us", "focus_lead_us"):
        changed = copy.deepcopy(given_)
        changed["camera"][-1][key] = changed["camera"][-1].get(key, 0.0) + 7.0
        with pytest.raises(InputError, match="and their pulses differ") as error:
            station_from_mapping(changed)
        assert "'cam35' share output" in error.value.problem
    given_["strobe"] = [{"output": 13}, {"output": 13}]
    with pytest.raises(InputError, match="output 13 is used by strobe 1 and by strobe 2"):
        station_from_mapping(given_)


def test_an_esper_box_starts_with_fire() -> None:
    for backend, lead_us in (("esper", 0.0), ("rigwright", 2000.0)):
        station = station_from_mapping({**data(), "trigger": {"url": "x", "backend": backend}})
        assert station.trigger is not None and station.trigger.lead_us == lead_us


def test_what_is_no_station_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not a station file"):
        parse_station("= nonsense")
    with pytest.raises(InputError, match="cannot read the station file"):
        read_station(tmp_path / "none.toml")
    path = tmp_path / "station.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="is not a text file"):
        read_station(path)
    path.write_bytes(b"#" * 1_000_001)
    with pytest.raises(TooLargeError, match="too large"):
        read_station(path)


def test_the_example_is_a_station() -> None:
    station = read_station(EXAMPLE)
    assert len(station.cameras) == 7
    assert station.trigger is not None and station.trigger.url.startswith("fake:")
    assert {camera.backend for camera in station.cameras} == {"simulated"}
    assert station.simulation is not None and station.board is not None
    design = read_rig_design(station)
    assert set(design.cameras) == {camera.name for camera in station.cameras}


KEYS = st.sampled_from(["name", "camera", "trigger", "capture", "led", "strobe", "schema", "x"])
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text("ab.[ \n", max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=6,
)


@given(st.dictionaries(KEYS, VALUES, max_size=4))
def test_whatever_is_given_ends_in_a_station_or_one_line(change: dict[str, Any]) -> None:
    try:
        station = station_from_mapping({**data(), **change})
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert isinstance(station, Station)


def test_the_example_is_the_one_of_the_program() -> None:
    assert EXAMPLE.read_text(encoding="utf-8") == example_station_text()
