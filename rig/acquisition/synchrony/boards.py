"""The station's timing board and how it is read."""

from __future__ import annotations

from dataclasses import asdict

from rig.acquisition.cameras.base import Image
from rig.acquisition.station.spec import Station
from rig.acquisition.synchrony.optical import ExposureReading
from rig.acquisition.synchrony.verdict import Board


def station_board(station: Station) -> Board | None:
    """How to read the board that stands in the pictures; None where the station has none."""
    if station.board is None:
        return None
    from rig.acquisition.timingboard.reading import TimingBoard, read_board

    board = TimingBoard(**asdict(station.board))

    def read(picture: Image, exposure_us: float | None) -> ExposureReading:
        return read_board(picture, board, exposure_us=exposure_us)

    return Board(read, board.range_us)
