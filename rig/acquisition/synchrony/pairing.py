"""Which picture belongs to which shot.

By time stamp against the trigger, through the camera's clock; frame counters are a cross-check;
order of arrival is a labelled last resort. Where two answers are possible none is given: a
missing picture is named and can be taken again, a wrong one is found weeks later.
"""

from __future__ import annotations

from collections.abc import Sequence

from rig.acquisition.cameras.base import FrameStatus
from rig.acquisition.synchrony.arrivalorder import (
    STRAYS_OF_A_FREE_RUN,
    by_arrival,
    free_running,
    missing,
)
from rig.acquisition.synchrony.cameraframes import CameraFrames, Pair, Pairing
from rig.acquisition.synchrony.clocks import NS_PER_US, TriggerTime
from rig.acquisition.synchrony.counters import counter_faults
from rig.acquisition.synchrony.exposures import Exposure, choose, distinct_exposures
from rig.acquisition.synchrony.faults import Fault, FaultKind

ARRIVAL_SLACK_NS = 1_000_000
"""How much before its exposure a picture may seem to arrive: the fit of a clock just after it
was read for the first time is no better."""


def pair(received: CameraFrames) -> Pairing:
    """Give each picture of one camera its shot, and name everything that is wrong."""
    exposures, faults = distinct_exposures(received)
    reset = _reset(received, exposures)
    faults += [] if reset is None else [reset]
    stamped = all(e.at_host_ns is not None for e in exposures) and received.clock is not None
    if stamped and reset is None:
        pairs, found = _by_timestamp(received, exposures)
    else:
        pairs, found = by_arrival(received, exposures)
    faults += found
    pairs, found = _with_pictures(received, pairs)
    faults += found
    faults += late_faults(received, pairs)
    return Pairing(received.camera, tuple(pairs), tuple(faults))


def late_faults(received: CameraFrames, pairs: Sequence[Pair]) -> list[Fault]:
    """What is to be said of pictures that came late, or not as a whole."""
    return [fault for one in pairs for fault in _of_status(received, one)]


def _with_pictures(received: CameraFrames, pairs: Sequence[Pair]) -> tuple[list[Pair], list[Fault]]:
    """The pairs whose frames hold a picture, and a fault for each whose transport lost it."""
    good = [one for one in pairs if one.frame.has_picture]
    lost = [
        Fault(
            _kind_of_loss(one),
            f"{received.camera}: the picture of shot {one.shot} was lost on its way"
            + (f" ({why})" if (why := one.frame.metadata.get("problem")) else ""),
            received.camera,
            one.shot,
        )
        for one in pairs
        if not one.frame.has_picture
    ]
    return good, lost


def _kind_of_loss(one: Pair) -> FaultKind:
    incomplete = one.frame.status is FrameStatus.INCOMPLETE
    return FaultKind.INCOMPLETE if incomplete else FaultKind.MISSING


def window_us(received: CameraFrames, uncertainty_us: float) -> tuple[float, float]:
    """Earliest and latest start of an exposure after its instant."""
    earliest = max(0.0, received.lag_us - received.lag_tolerance_us)
    return earliest - uncertainty_us, received.lag_us + received.lag_tolerance_us + uncertainty_us


def _reset(received: CameraFrames, exposures: Sequence[Exposure]) -> Fault | None:
    """The fault when the camera's stamps cannot be believed."""
    what = ""
    if received.clock_jumped:
        what = "its clock was set or began anew during the capture"
    for e in exposures:
        if _before_its_exposure(e):
            what = "a picture is stamped later than it arrived"
    if not what:
        return None
    text = f"{received.camera}: {what}; its time stamps are not used"
    return Fault(FaultKind.TIMESTAMP_RESET, text, received.camera)


def _before_its_exposure(exposure: Exposure) -> bool:
    """Whether a picture arrived before it can have been exposed, whatever is not known."""
    if exposure.at_host_ns is None:
        return False
    earliest_ns = exposure.at_host_ns - exposure.uncertainty_us * NS_PER_US
    return earliest_ns > exposure.frame.arrived_host_ns + ARRIVAL_SLACK_NS


def _by_timestamp(
    received: CameraFrames, exposures: list[Exposure]
) -> tuple[list[Pair], list[Fault]]:
    ordered = sorted(exposures, key=lambda e: e.time_ns)
    windows = [_window(received, trigger_time) for trigger_time in received.trigger_times]
    hits = [[e for e in ordered if _within(window, e)] for window in windows]
    claimed = {id(e) for hit in hits for e in hit}
    strays = [e for e in ordered if id(e) not in claimed]
    fresh = [e for e in strays if e.time_ns >= received.armed_host_ns]
    lag_off = _lag_off(received, ordered) if not claimed else None
    if lag_off is not None:
        return [], [lag_off, *missing(received, [])]
    if len(fresh) >= max(STRAYS_OF_A_FREE_RUN, len(received.trigger_times) // 5):
        return [], [free_running(received, len(fresh)), *missing(received, [])]
    pairs, faults = choose(received, hits)
    faults = _strays(received, strays, windows[0][0]) + faults
    counted = counter_faults(received, pairs, [e.frame.counter for e in ordered])
    if any(fault.kind is FaultKind.COUNTER_CONFLICT for fault in counted):
        return [], [*faults, *counted]
    return pairs, [*faults, *counted, *missing(received, pairs, hits)]


def _window(received: CameraFrames, trigger_time: TriggerTime) -> tuple[float, float]:
    """Earliest and latest start of a shot's exposure, on a clock that is exact; in ns."""
    first, last = window_us(received, trigger_time.uncertainty_us)
    at = trigger_time.at_host_ns
    return at + first * NS_PER_US, at + last * NS_PER_US


def _within(window: tuple[float, float], e: Exposure) -> bool:
    slack = e.uncertainty_us * NS_PER_US
    return window[0] - slack <= e.time_ns <= window[1] + slack


def _strays(received: CameraFrames, strays: list[Exposure], first_window: float) -> list[Fault]:
    faults = []
    for e in strays:
        if e.time_ns < first_window:
            text = f"{received.camera}: a picture from before the first shot is left out"
            faults.append(Fault(FaultKind.EXTRA_AT_START, text, received.camera))
        else:
            text = (
                f"{received.camera}: a picture lies {_off(received, e):.1f} ms after the shot "
                "before it, where no shot puts it; it is left out. No shot asked for it: look "
                "whether the camera runs freely"
            )
            faults.append(Fault(FaultKind.EXTRA, text, received.camera))
    return faults


def _lag_off(received: CameraFrames, ordered: Sequence[Exposure]) -> Fault | None:
    """The fault of a camera that answers every shot, but not when it is expected to."""
    if len(ordered) != len(received.trigger_times):
        return None
    lags_us = [
        (e.time_ns - trigger_time.at_host_ns) / NS_PER_US
        for e, trigger_time in zip(ordered, received.trigger_times, strict=True)
    ]
    if min(lags_us) < 0.0 or max(lags_us) - min(lags_us) > received.lag_tolerance_us:
        return None
    text = (
        f"{received.camera}: it exposed {lags_us[0] / 1e3:.1f} ms after its shot; expected was "
        f"{received.lag_us / 1e3:.1f} +- {received.lag_tolerance_us / 1e3:.1f} ms. If that is how "
        "it is, set expected_lag_us"
    )
    return Fault(FaultKind.LAG_OFF, text, received.camera)


def _off(received: CameraFrames, exposure: Exposure) -> float:
    before = [i.at_host_ns for i in received.trigger_times if i.at_host_ns <= exposure.time_ns]
    return (exposure.time_ns - max(before, default=received.trigger_times[0].at_host_ns)) / 1e6


def _of_status(received: CameraFrames, one: Pair) -> list[Fault]:
    if one.frame.status is FrameStatus.LATE or _arrived_late(received, one):
        text = f"{received.camera}: the picture of shot {one.shot} came after its deadline"
        return [Fault(FaultKind.LATE, text, received.camera, one.shot)]
    if one.frame.status is FrameStatus.INCOMPLETE:
        text = f"{received.camera}: part of the picture of shot {one.shot} is missing"
        return [Fault(FaultKind.INCOMPLETE, text, received.camera, one.shot)]
    return []


def _arrived_late(received: CameraFrames, one: Pair) -> bool:
    at = next(i.at_host_ns for i in received.trigger_times if i.shot == one.shot)
    since = next((asked for asked in received.asked_host_ns if asked >= at), at)
    return one.frame.arrived_host_ns - since > received.deadline_s * 1e9
