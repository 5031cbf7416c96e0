"""Measured delays written back to a station file, which otherwise stays as its author left it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from common.errors import InputError
from common.files.reading import BYTE_ORDER_MARK
from common.files.writing import write_whole
from rig.acquisition.station.stationfile import parse_station


@dataclass(frozen=True)
class Timing:
    """What was found out about one camera: its lag, and the delay that makes up for it."""

    delay_us: float
    expected_lag_us: float


def with_timings(text: str, timings: Mapping[str, Timing], name: str = "station") -> str:
    """The station file ``text`` with new delays by camera name; comments and order stay.

    So do the ends of its lines. Raises :class:`InputError` for a name that the file does not have.
    """
    import tomlkit

    end_of_line = "\r\n" if "\r\n" in text else "\n"
    station = parse_station(text, name)
    mark = BYTE_ORDER_MARK if text.startswith(BYTE_ORDER_MARK) else ""
    for camera in timings:
        station.camera(camera)
    document = tomlkit.parse(text.removeprefix(mark))
    for table in document["camera"]:
        found = timings.get(str(table["name"]))
        if found is not None:
            for key, value in asdict(found).items():
                item = tomlkit.item(round(value, 1))
                item.trivia.trail = end_of_line
                table[key] = item
    written = mark + tomlkit.dumps(document)
    parse_station(written, name)
    return written


def write_timings(path: Path, timings: Mapping[str, Timing]) -> None:
    """The same in the file itself: replaced whole, or left as it was.

    Raises :class:`InputError` when it cannot be read or written.
    """
    try:
        text = with_timings(path.read_bytes().decode(), timings, path.name)
    except OSError as error:
        raise InputError(
            "station-unreadable",
            f"cannot read the station file {path} ({(error.strerror or '').lower()})",
            "check the path",
        ) from error
    write_whole(path, text.encode(), overwrite=True)
