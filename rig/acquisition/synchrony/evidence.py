"""What proves that the cameras of a capture exposed together, in three levels.

A: the box's own log of its edges. B: the cameras' time stamps against those edges. C: an LED
timing board in the pictures (:mod:`.optical`). Uncertainties are half widths.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from statistics import median

from rig.acquisition.cameras.base import CameraCapabilities, TimestampKind, TriggerKind
from rig.acquisition.synchrony.cameraframes import Pair
from rig.acquisition.synchrony.capturedata import CameraPart, CaptureData
from rig.acquisition.synchrony.clocks import NS_PER_US, TriggerTimeSource

PTP_UNCERTAINTY_US = 10.0
"""What is claimed for PTP among cameras that do not say more (docs/explanation/capture.md)."""


class SyncClass(StrEnum):
    """By what a camera is made to expose together with the others."""

    HARDWARE = "hardware"
    PTP = "ptp"
    SOFTWARE = "software"
    NONE = "none"


class Passed(StrEnum):
    """A figure against its limit, its uncertainty considered."""

    PASS = "pass"  # noqa: S105  a verdict, not a secret
    FAIL = "fail"
    UNDECIDED = "undecided"
    """The limit lies within the uncertainty."""


def sync_class(capabilities: CameraCapabilities, output: int | None) -> SyncClass:
    """The class of a camera that hangs on ``output`` of the box, or on none."""
    if capabilities.trigger is TriggerKind.EDGE and output is not None:
        return SyncClass.HARDWARE
    if capabilities.trigger is TriggerKind.SOFTWARE:
        ptp = capabilities.timestamps is TimestampKind.PTP
        return SyncClass.PTP if ptp else SyncClass.SOFTWARE
    return SyncClass.NONE


@dataclass(frozen=True)
class EdgeEvidence:
    """Level A. ``error_us``: the largest difference of an edge to what was programmed."""

    outcome: str
    acknowledged: bool
    edges: int
    shots_done: int
    shots_wanted: int
    error_us: float
    clock_uncertainty_us: float
    why: str = ""


@dataclass(frozen=True)
class FrameTiming:
    """One picture in time; what is not known is NaN.

    Lag is from instant to exposure; ``skew_us`` of the exposure's middle from the median of all
    cameras (of its start, where an exposure time is unknown).
    """

    camera: str
    shot: int
    lag_us: float
    lag_uncertainty_us: float
    skew_us: float
    skew_uncertainty_us: float
    exposure_us: float
    source: TriggerTimeSource


@dataclass(frozen=True)
class ShotTiming:
    """One shot over all cameras. ``spread_us`` from the first to the last exposure's middle.

    ``overlap_us``: for how long all shutters were open at once (negative: never), NaN unknown.
    """

    shot: int
    cameras: int
    spread_us: float
    spread_uncertainty_us: float
    overlap_us: float
    middles: bool
    """Whether middles were compared; else starts."""


@dataclass(frozen=True)
class CameraTiming:
    """One camera over all shots: the median lag, and the skew of the worst shot."""

    camera: str
    sync_class: SyncClass
    timestamps: TimestampKind
    shots: int
    lag_us: float
    lag_uncertainty_us: float
    skew_us: float
    skew_uncertainty_us: float
    exposure_us: float
    passed: Passed | None


@dataclass(frozen=True)
class StampEvidence:
    """Level B."""

    frames: tuple[FrameTiming, ...]
    shots: tuple[ShotTiming, ...]
    cameras: tuple[CameraTiming, ...]


def against(limit_us: float, value_us: float, uncertainty_us: float) -> Passed | None:
    """Whether ``value_us`` keeps within the limit for certain; None when it is unknown."""
    if not (math.isfinite(value_us) and math.isfinite(uncertainty_us)):
        return None
    if abs(value_us) + uncertainty_us <= limit_us:
        return Passed.PASS
    return Passed.FAIL if abs(value_us) - uncertainty_us > limit_us else Passed.UNDECIDED


def edge_evidence(captured: CaptureData) -> EdgeEvidence | None:
    """Level A; None when no box took part."""
    report, request = captured.report, captured.request
    if report is None or request is None:
        return None
    errors = [
        edge.at_us - request.pulses[edge.output].delay_us
        for edge in report.edges
        if edge.rising and edge.output in request.pulses
    ]
    late = [edge.late_us for edge in report.edges]
    return EdgeEvidence(
        outcome=report.outcome.value,
        acknowledged=report.acknowledged,
        edges=len(report.edges),
        shots_done=report.shots_done,
        shots_wanted=report.shots_wanted,
        error_us=max(map(abs, (*errors, *late)), default=math.nan),
        clock_uncertainty_us=report.clock_uncertainty_us,
        why=report.why,
    )


def stamp_evidence(captured: CaptureData, limit_us: float) -> StampEvidence:
    """Level B for all cameras, with NaN for those whose stamps say nothing."""
    frames: list[FrameTiming] = []
    shots: list[ShotTiming] = []
    for shot in range(1, captured.shots + 1):
        pairs = [(part, part.pairing.pair(shot)) for part in captured.parts]
        timed = [_timed(part, pair) for part, pair in pairs if pair is not None]
        if timed:
            shots.append(_shot_timing(shot, timed))
            frames += _frame_timings(shot, timed)
    cameras = tuple(_camera_timing(part, frames, limit_us) for part in captured.parts)
    return StampEvidence(tuple(frames), tuple(shots), cameras)


@dataclass(frozen=True, eq=False)
class _Timed:
    """A picture with the start of its exposure in microseconds of some clock of all cameras."""

    part: CameraPart
    pair: Pair
    start_us: float
    uncertainty_us: float
    exposure_us: float
    ptp: bool


def _timed(part: CameraPart, pair: Pair) -> _Timed:
    exposure = pair.frame.exposure_us or part.settings.exposure_us or math.nan
    if pair.exposed_host_ns is not None:
        start, uncertainty = pair.exposed_host_ns / NS_PER_US, pair.uncertainty_us
        return _Timed(part, pair, start, uncertainty, exposure, False)
    ptp = part.received.capabilities.timestamps is TimestampKind.PTP
    if ptp and pair.frame.device_ns is not None:
        start = pair.frame.device_ns / NS_PER_US
        return _Timed(part, pair, start, PTP_UNCERTAINTY_US, exposure, True)
    return _Timed(part, pair, math.nan, math.nan, exposure, False)


def _comparable(timed: list[_Timed]) -> list[_Timed]:
    """Those whose stamps are of one clock: the host's, or else that of PTP."""
    known = [t for t in timed if math.isfinite(t.start_us)]
    hosts = [t for t in known if not t.ptp]
    return hosts or known


def _middles(timed: list[_Timed]) -> bool:
    return all(math.isfinite(t.exposure_us) for t in timed)


def _at_us(t: _Timed, middles: bool) -> float:
    return t.start_us + (t.exposure_us / 2.0 if middles else 0.0)


def _shot_timing(shot: int, timed: list[_Timed]) -> ShotTiming:
    known = _comparable(timed)
    if not known:
        return ShotTiming(shot, 0, math.nan, math.nan, math.nan, False)
    middles = _middles(known)
    ordered = sorted(known, key=lambda t: _at_us(t, middles))
    first, last = ordered[0], ordered[-1]
    spread = _at_us(last, middles) - _at_us(first, middles)
    uncertainty = first.uncertainty_us + last.uncertainty_us if first is not last else 0.0
    opened = max(t.start_us for t in known)
    closed = min(t.start_us + t.exposure_us for t in known)
    overlap = closed - opened if middles else math.nan
    return ShotTiming(shot, len(known), spread, uncertainty, overlap, middles)


def _frame_timings(shot: int, timed: list[_Timed]) -> Iterable[FrameTiming]:
    known = _comparable(timed)
    middles = _middles(known)
    centre = median(_at_us(t, middles) for t in known) if known else math.nan
    about = median(t.uncertainty_us for t in known) if len(known) > 1 else 0.0
    for t in timed:
        trigger_time = next(i for i in t.part.received.trigger_times if i.shot == shot)
        inside = t in known
        lagged = inside and not t.ptp and trigger_time.source is not TriggerTimeSource.NONE
        lag = t.start_us - trigger_time.at_host_ns / NS_PER_US if lagged else math.nan
        yield FrameTiming(
            camera=t.part.plan.name,
            shot=shot,
            lag_us=lag,
            lag_uncertainty_us=t.uncertainty_us + trigger_time.uncertainty_us
            if lagged
            else math.nan,
            skew_us=_at_us(t, middles) - centre if inside else math.nan,
            skew_uncertainty_us=t.uncertainty_us + about if inside else math.nan,
            exposure_us=t.exposure_us,
            source=trigger_time.source,
        )


def _camera_timing(part: CameraPart, frames: list[FrameTiming], limit_us: float) -> CameraTiming:
    mine = [f for f in frames if f.camera == part.plan.name]
    lagged = [f for f in mine if math.isfinite(f.lag_us)]
    skewed = [f for f in mine if math.isfinite(f.skew_us)]
    worst = max(skewed, key=lambda f: abs(f.skew_us), default=None)
    skew = math.nan if worst is None else worst.skew_us
    uncertainty = math.nan if worst is None else worst.skew_uncertainty_us
    capabilities = part.received.capabilities
    return CameraTiming(
        camera=part.plan.name,
        sync_class=sync_class(capabilities, part.plan.output),
        timestamps=capabilities.timestamps,
        shots=len(mine),
        lag_us=median(f.lag_us for f in lagged) if lagged else math.nan,
        lag_uncertainty_us=max((f.lag_uncertainty_us for f in lagged), default=math.nan),
        skew_us=skew,
        skew_uncertainty_us=uncertainty,
        exposure_us=median(f.exposure_us for f in mine) if mine else math.nan,
        passed=against(limit_us, skew, uncertainty),
    )
