"""Level C of the evidence: what an LED timing board in the pictures says.

The board's counter starts at an edge of the box, so a picture of it gives the instant of its
exposure without believing any clock of the camera.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from common.errors import InputError
from rig.acquisition.cameras.base import Frame, Image
from rig.acquisition.imaging import decoded
from rig.acquisition.station.spec import Station
from rig.acquisition.synchrony.capturedata import CameraPart, CaptureData

SURE = 3.0
"""Standard deviations that count as the half width of a reading."""


class ExposureReading(Protocol):
    """What reading a picture of the board gives: microseconds of the board's counter."""

    @property
    def mid_us(self) -> float:
        """The middle of the exposure."""
        ...

    @property
    def exposure_us(self) -> float:
        """Its length."""
        ...

    @property
    def mid_sigma_us(self) -> float:
        """Standard deviation of the middle."""
        ...

    @property
    def exposure_sigma_us(self) -> float:
        """Standard deviation of the length."""
        ...


BoardReader = Callable[[Image, float | None], ExposureReading]
"""Reads a picture, given the exposure time in microseconds where it is known.

Raises :class:`InputError` where the board is not seen or not readable.
"""


@dataclass(frozen=True)
class FrameReading:
    """One picture's reading. ``lag_us``: from the camera's edge to the start of its exposure."""

    camera: str
    shot: int
    mid_us: float
    uncertainty_us: float
    exposure_us: float
    lag_us: float
    lag_uncertainty_us: float


@dataclass(frozen=True)
class OpticalEvidence:
    """Level C. ``unread``: cameras with a picture without a reading, and why.

    ``spread_us``: of the exposures' middles over the cameras that were read, in the worst shot.
    """

    readings: tuple[FrameReading, ...]
    unread: dict[str, str]
    spread_us: float
    spread_uncertainty_us: float


def optical_evidence(
    station: Station, captured: CaptureData, read: BoardReader, range_us: float
) -> OpticalEvidence:
    """Read the board in every picture. ``range_us``: when its counter begins again."""
    readings: list[FrameReading] = []
    unread: dict[str, str] = {}
    for part in captured.parts:
        for one in part.pairing.pairs:
            try:
                found = _read(one.frame, part, read)
            except InputError as error:
                unread[part.plan.name] = error.problem
                continue
            readings.append(_reading(station, part, one.shot, found, range_us))
    spread, uncertainty = _spread(readings)
    return OpticalEvidence(tuple(readings), unread, spread, uncertainty)


def _read(frame: Frame, part: CameraPart, read: BoardReader) -> ExposureReading:
    exposure = frame.exposure_us or part.settings.exposure_us
    if frame.pixels is not None:
        return read(frame.pixels, exposure)
    if frame.encoded is None:
        raise InputError("board-no-picture", "there is no picture", "take it again")
    pixels = decoded(frame.encoded)
    if pixels is None:
        raise InputError("board-no-picture", "the picture cannot be decoded", "take it again")
    return read(pixels, exposure)


def _reading(
    station: Station, part: CameraPart, shot: int, found: ExposureReading, range_us: float
) -> FrameReading:
    start = found.mid_us - found.exposure_us / 2.0
    edge = station.shutter_delay_us(part.plan) - _board_zero_us(station)
    # The counter goes round; a lag is taken as the one nearest to what is expected.
    off = start - edge - part.plan.expected_lag_us
    lag = part.plan.expected_lag_us + (off + range_us / 2.0) % range_us - range_us / 2.0
    lag_sigma = math.hypot(found.mid_sigma_us, found.exposure_sigma_us / 2.0)
    return FrameReading(
        camera=part.plan.name,
        shot=shot,
        mid_us=edge + lag + found.exposure_us / 2.0,
        uncertainty_us=SURE * found.mid_sigma_us,
        exposure_us=found.exposure_us,
        lag_us=lag if part.plan.output is not None and station.leds else math.nan,
        lag_uncertainty_us=SURE * lag_sigma,
    )


def _board_zero_us(station: Station) -> float:
    """When the board's counter starts, from the shot's start at the box."""
    first = min((light.delay_us for light in station.leds), default=0.0)
    return station.zero_us + first


def _spread(readings: list[FrameReading]) -> tuple[float, float]:
    """The largest spread of any shot and its uncertainty, NaN below two cameras."""
    worst = (math.nan, math.nan)
    for shot in {r.shot for r in readings}:
        here = sorted((r for r in readings if r.shot == shot), key=lambda r: r.mid_us)
        if len(here) < 2:
            continue
        spread = here[-1].mid_us - here[0].mid_us
        if not spread <= worst[0]:
            worst = (spread, here[0].uncertainty_us + here[-1].uncertainty_us)
    return worst
