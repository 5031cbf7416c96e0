"""Each camera's shutter lag from several captures, and the delays that make up for the lags."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median

from common.errors import InputError
from rig.acquisition.station.delays import Timing
from rig.acquisition.station.spec import CameraPlan, Station
from rig.acquisition.synchrony.verdict import Evidence

NORMAL = 1.4826
"""Median absolute deviation to standard deviation, for a normal distribution."""

CHANCE = 0.005
"""A trend that chance would show less often than this is a drift."""
LEAST_DRIFT_US = 200.0
"""A lag that moves by less in a check matters to no exposure that such a rig makes."""
CLOCK_US = 1000.0
"""How far before its edge an exposure may seem to begin: clocks and stamps are not better."""


@dataclass(frozen=True)
class LagEstimate:
    """The median lag of ``count`` pictures.

    ``jitter_us``: their robust standard deviation; ``uncertainty_us``: the half width within
    which the median is known; ``source``: ``optical`` or ``timestamps``.
    """

    camera: str
    lag_us: float
    jitter_us: float
    uncertainty_us: float
    count: int
    exposure_us: float
    source: str
    drift_us: float = 0.0
    """By how much it has moved from the first capture to the last; 0 where none can be told."""


def estimate_lags(captures: Sequence[Evidence]) -> dict[str, LagEstimate]:
    """One estimate per camera that showed its lag; the timing board is believed before stamps."""
    optical: dict[str, list[tuple[float, float, float]]] = {}
    stamped: dict[str, list[tuple[float, float, float]]] = {}
    for evidence in captures:
        for r in evidence.optical.readings if evidence.optical is not None else ():
            if math.isfinite(r.lag_us):
                figures = (r.lag_us, r.lag_uncertainty_us, r.exposure_us)
                optical.setdefault(r.camera, []).append(figures)
        for f in evidence.stamps.frames:
            if math.isfinite(f.lag_us):
                figures = (f.lag_us, f.lag_uncertainty_us, f.exposure_us)
                stamped.setdefault(f.camera, []).append(figures)
    names = sorted(optical.keys() | stamped.keys())
    return {
        name: _estimate(name, optical[name], "optical")
        if name in optical
        else _estimate(name, stamped[name], "timestamps")
        for name in names
    }


def _estimate(name: str, figures: Sequence[tuple[float, float, float]], source: str) -> LagEstimate:
    lags = [figure[0] for figure in figures]
    middle = median(lags)
    jitter = NORMAL * median(abs(lag - middle) for lag in lags) if len(lags) > 1 else math.nan
    known = max(figure[1] for figure in figures)
    scatter = 0.0 if math.isnan(jitter) else 3.0 * jitter / math.sqrt(len(lags))
    exposure = median(figure[2] for figure in figures)
    return LagEstimate(
        name, middle, jitter, known + scatter, len(lags), exposure, source, _drift_us(lags, known)
    )


def _drift_us(lags: Sequence[float], known_us: float) -> float:
    """How far a line through the lags moves, where it moves more than chance would let it."""
    if len(lags) < 3:
        return 0.0
    from scipy.stats import linregress

    line = linregress(range(len(lags)), lags)
    moved = float(line.slope) * (len(lags) - 1)
    return moved if line.pvalue < CHANCE and abs(moved) > max(known_us, LEAST_DRIFT_US) else 0.0


def new_timings(station: Station, estimates: Mapping[str, LagEstimate]) -> dict[str, Timing]:
    """Delays under which all exposures' middles (or starts) coincide; the smallest one is 0.

    Cameras that share an output share its delay: the middle of theirs is brought together with
    the others, and what they differ by stays.

    Cameras on no output keep theirs. Raises :class:`InputError` when a camera on an output has
    no estimate, because the others would be moved away from it; and for a lag that it cannot
    have, or that drifts.
    """
    wired = [camera for camera in station.cameras if camera.output is not None]
    dumb = [camera.name for camera in wired if camera.name not in estimates]
    if dumb or not wired:
        which = ", ".join(dumb) or "no camera on an output"
        raise InputError(
            "lag-unknown",
            f"the lag of {which} could not be measured",
            "put the timing board where every camera sees it, or use cameras with time stamps",
        )
    for camera in wired:
        _require_possible(camera, estimates[camera.name])
    # Middles can be brought together only where every exposure's length is known.
    middles = all(math.isfinite(estimates[camera.name].exposure_us) for camera in wired)
    late = {camera.name: _late_us(estimates[camera.name], middles) for camera in wired}
    together = {
        camera.name: _middle([late[other.name] for other in group])
        for group in _on_common_outputs(wired)
        for camera in group
    }
    latest = max(together.values())
    return {
        camera.name: Timing(latest - together[camera.name], max(0.0, estimates[camera.name].lag_us))
        for camera in wired
    }


def _on_common_outputs(wired: Sequence[CameraPlan]) -> list[list[CameraPlan]]:
    """Cameras that share an output, for their shutters or their focus, directly or by others.

    They have one delay.
    """
    groups: list[tuple[set[int | None], list[CameraPlan]]] = []
    for camera in wired:
        outputs = {camera.output, camera.focus_output} - {None}
        mine = [group for group in groups if group[0] & outputs]
        groups = [group for group in groups if group not in mine]
        joined = [other for _, cameras in mine for other in cameras]
        groups.append((outputs.union(*(taken for taken, _ in mine)), [*joined, camera]))
    return [cameras for _, cameras in groups]


def _middle(values: Sequence[float]) -> float:
    return (min(values) + max(values)) / 2.0


def _require_possible(camera: CameraPlan, estimate: LagEstimate) -> None:
    """A lag that no such camera has was misread, and one that drifts is another one tomorrow."""
    off = abs(estimate.lag_us - camera.expected_lag_us)
    room = estimate.uncertainty_us
    if off > camera.lag_tolerance_us + room or estimate.lag_us < -room - CLOCK_US:
        raise InputError(
            "lag-impossible",
            f"{camera.name} seems to expose {estimate.lag_us / 1e3:.2f} ms after its edge, and "
            f"{camera.expected_lag_us / 1e3:.2f} +- {camera.lag_tolerance_us / 1e3:.2f} ms are "
            "expected",
            "look at its pictures and at its cable; if it is true, change expected_lag_us or "
            "lag_tolerance_us",
        )
    if estimate.drift_us:
        raise InputError(
            "lag-drifting",
            f"the lag of {camera.name} moved by {estimate.drift_us / 1e3:.2f} ms in "
            f"{estimate.count} captures",
            "let it warm up, or see to its clock, then check again",
        )


def _late_us(estimate: LagEstimate, middles: bool) -> float:
    """From the edge to the middle of the exposure, or to its start."""
    return estimate.lag_us + (estimate.exposure_us / 2.0 if middles else 0.0)


def with_new_timings(station: Station, timings: Mapping[str, Timing]) -> Station:
    """The station with these delays and lags."""
    cameras = []
    for camera in station.cameras:
        found = timings.get(camera.name)
        if found is not None:
            camera = replace(camera, delay_us=found.delay_us, expected_lag_us=found.expected_lag_us)
        cameras.append(camera)
    return replace(station, cameras=tuple(cameras))
