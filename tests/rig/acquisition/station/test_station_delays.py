"""Measured delays go back into the file; everything else in it stays."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.errors import InputError
from rig.acquisition.station.delays import Timing, with_timings, write_timings
from rig.acquisition.station.stationfile import parse_station

TEXT = """# Our bench. Do not touch the cables!
schema = "rigwright.station/1"
name = "Bench"   # in the cellar

[trigger]
url = "/dev/serial/by-id/box"

[[camera]]
name = "cam01"
backend = "gphoto2"
id = "SN1"   # the one with the scratch
output = 1
delay_us = 0.0   # measured in spring

[[camera]]
name = "cam02"
backend = "gphoto2"
id = "SN2"
output = 2

[camera.settings]
iso = 100
"""
FOUND = {"cam01": Timing(1234.567, 58_000.04), "cam02": Timing(0.0, 59_234.6)}


def test_comments_and_order_stay() -> None:
    written = with_timings(TEXT, FOUND)
    station = parse_station(written)
    assert [c.delay_us for c in station.cameras] == [1234.6, 0.0]
    assert [c.expected_lag_us for c in station.cameras] == [58_000.0, 59_234.6]
    for line in TEXT.splitlines():
        assert line.replace("delay_us = 0.0", "delay_us = 1234.6") in written
    assert station.cameras[1].settings.iso == 100


def test_only_the_named_cameras_change() -> None:
    written = with_timings(TEXT, {"cam02": FOUND["cam02"]})
    assert parse_station(written).cameras[0] == parse_station(TEXT).cameras[0]
    with pytest.raises(InputError, match="no camera 'cam03'"):
        with_timings(TEXT, {"cam03": FOUND["cam02"]})


def test_the_file_is_replaced_whole_and_keeps_its_mode(tmp_path: Path) -> None:
    path = tmp_path / "station.toml"
    path.write_text(TEXT)
    path.chmod(0o640)
    write_timings(path, FOUND)
    assert path.read_text() == with_timings(TEXT, FOUND)
    assert path.stat().st_mode & 0o777 == 0o640
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_the_ends_of_all_lines_stay(tmp_path: Path, end: str) -> None:
    path = tmp_path / "station.toml"
    path.write_bytes(TEXT.replace("\n", end).encode())
    write_timings(path, FOUND)
    assert path.read_bytes().decode() == with_timings(TEXT, FOUND).replace("\n", end)


def test_what_cannot_be_written_leaves_the_file_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "station.toml"
    path.write_text(TEXT)

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(InputError, match=r"station\.toml cannot be written") as error:
        write_timings(path, FOUND)
    assert error.value.code == "input/file-write"
    assert path.read_text() == TEXT and list(tmp_path.iterdir()) == [path]


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot read the station file"):
        write_timings(tmp_path / "none.toml", FOUND)
