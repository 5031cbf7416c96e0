"""Which picture belongs to which shot.

By time stamp against the trigger, through the camera's clock; frame counters are a cross-check;
order of arrival is a labelled last resort. Where two answers are possible none is given: a
missing picture is named and can be taken again, a wrong one is found weeks later.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from rig.acquisition.cameras.base import Frame, FrameStatus
from rig.acquisition.synchrony.cameraframes import CameraFrames, Method, Pair, Pairing
from rig.acquisition.synchrony.clocks import NS_PER_US, DeviceClock
from rig.acquisition.synchrony.counters import counter_faults, steps
from rig.acquisition.synchrony.faults import Fault, FaultKind

SAME_EXPOSURE_NS = 1000
"""Stamps nearer than this are of one exposure: no camera exposes twice within a microsecond."""

STRAYS_OF_A_FREE_RUN = 2
"""One picture nobody asked for happens (some cameras give one when armed); two do not."""

ARRIVAL_SLACK_NS = 1_000_000
"""How much before its exposure a picture may seem to arrive: the fit of a clock just after it
was read for the first time is no better."""

RANK = {FrameStatus.OK: 0, FrameStatus.LATE: 1, FrameStatus.INCOMPLETE: 2}


@dataclass(frozen=True, eq=False)
class Exposure:
    """One exposure, however often its picture was delivered; ``at_host_ns`` where known."""

    frame: Frame
    copies: int
    at_host_ns: int | None
    uncertainty_us: float = float("inf")

    @property
    def time_ns(self) -> int:
        """The start of an exposure whose start is known."""
        return self.at_host_ns if self.at_host_ns is not None else 0


def pair(received: CameraFrames) -> Pairing:
    """Give each picture of one camera its shot, and name everything that is wrong."""
    exposures, faults = _exposures(received)
    reset = _reset(received, exposures)
    faults += [] if reset is None else [reset]
    stamped = all(e.at_host_ns is not None for e in exposures) and received.clock is not None
    if stamped and reset is None:
        pairs, found = _by_timestamp(received, exposures)
    else:
        pairs, found = _by_arrival(received, exposures)
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
            FaultKind.MISSING,
            f"{received.camera}: the picture of shot {one.shot} was lost on its way"
            + (f" ({why})" if (why := one.frame.metadata.get("problem")) else ""),
            received.camera,
            one.shot,
        )
        for one in pairs
        if not one.frame.has_picture
    ]
    return good, lost


def window_us(received: CameraFrames, uncertainty_us: float) -> tuple[float, float]:
    """Earliest and latest start of an exposure after its instant."""
    earliest = max(0.0, received.lag_us - received.lag_tolerance_us)
    return earliest - uncertainty_us, received.lag_us + received.lag_tolerance_us + uncertainty_us


def _exposures(received: CameraFrames) -> tuple[list[Exposure], list[Fault]]:
    groups: list[list[Frame]] = []
    for frame in received.frames:
        group = next((g for g in groups if _same_exposure(g[0], frame)), None)
        if group is None:
            groups.append([frame])
        else:
            group.append(frame)
    exposures = [_exposure(received.clock, group) for group in groups]
    twice = [e for e in exposures if e.copies > 1]
    faults = [
        Fault(
            FaultKind.DUPLICATE,
            f"{received.camera}: one picture was delivered {e.copies} times; one is kept",
            received.camera,
        )
        for e in twice
    ]
    return exposures, faults


def _exposure(clock: DeviceClock | None, group: Sequence[Frame]) -> Exposure:
    best, stamp = min(group, key=lambda f: RANK[f.status]), group[0].device_ns
    if clock is None or stamp is None:
        return Exposure(best, len(group), None)
    return Exposure(best, len(group), clock.host_ns(stamp), clock.uncertainty_us(stamp))


def _same_exposure(a: Frame, b: Frame) -> bool:
    if a.device_ns is not None and b.device_ns is not None:
        return abs(a.device_ns - b.device_ns) < SAME_EXPOSURE_NS
    return a.counter is not None and a.counter == b.counter


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
    worst_us = max((e.uncertainty_us for e in exposures), default=0.0)
    windows = _windows(received, worst_us)
    if any(b[0] <= a[1] for a, b in pairwise(windows)):
        text = f"{received.camera}: the shots follow too fast to tell them apart by its lag"
        return [], [Fault(FaultKind.AMBIGUOUS, text, received.camera)]
    hits = [[e for e in ordered if first <= e.time_ns <= last] for first, last in windows]
    claimed = {id(e) for hit in hits for e in hit}
    strays = [e for e in ordered if id(e) not in claimed]
    fresh = [e for e in strays if e.time_ns >= received.armed_host_ns]
    lag_off = _lag_off(received, ordered) if not claimed else None
    if lag_off is not None:
        return [], [lag_off, *_missing(received, [])]
    if len(fresh) >= max(STRAYS_OF_A_FREE_RUN, len(received.trigger_times) // 5):
        return [], [_free_running(received, len(fresh)), *_missing(received, [])]
    pairs, faults = _choose(received, hits)
    faults = _strays(received, strays, windows[0][0]) + faults
    counted = counter_faults(received, pairs, [e.frame.counter for e in ordered])
    if any(fault.kind is FaultKind.COUNTER_CONFLICT for fault in counted):
        return [], [*faults, *counted]
    return pairs, [*faults, *counted, *_missing(received, pairs, hits)]


def _windows(received: CameraFrames, clock_us: float) -> list[tuple[float, float]]:
    windows = []
    for trigger_time in received.trigger_times:
        first, last = window_us(received, trigger_time.uncertainty_us + clock_us)
        at = trigger_time.at_host_ns
        windows.append((at + first * NS_PER_US, at + last * NS_PER_US))
    return windows


def _choose(received: CameraFrames, hits: list[list[Exposure]]) -> tuple[list[Pair], list[Fault]]:
    pairs, faults = [], []
    for trigger_time, hit in zip(received.trigger_times, hits, strict=True):
        if len(hit) == 1:
            e = hit[0]
            of_clock = (e.at_host_ns, e.uncertainty_us)
            pairs.append(Pair(trigger_time.shot, e.frame, Method.TIMESTAMP, *of_clock))
        elif hit:
            text = (
                f"{received.camera}: {len(hit)} exposures were made about shot "
                f"{trigger_time.shot}; which one it fired cannot be told"
            )
            faults.append(Fault(FaultKind.AMBIGUOUS, text, received.camera, trigger_time.shot))
    return pairs, faults


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


def _free_running(received: CameraFrames, count: int) -> Fault:
    return Fault(
        FaultKind.FREE_RUNNING,
        f"{received.camera}: {count} pictures were made that no shot asked for: it is not "
        "triggered from outside; check its trigger cable and trigger mode",
        received.camera,
    )


def _missing(
    received: CameraFrames, pairs: Sequence[Pair], hits: Sequence[Sequence[Exposure]] | None = None
) -> list[Fault]:
    have = {one.shot for one in pairs}
    contested = {
        trigger_time.shot
        for trigger_time, hit in zip(received.trigger_times, hits or (), strict=False)
        if hit
    }
    return [
        Fault(
            FaultKind.MISSING,
            f"{received.camera}: no picture of shot {trigger_time.shot}",
            received.camera,
            trigger_time.shot,
        )
        for trigger_time in received.trigger_times
        if trigger_time.shot not in have | contested
    ]


def _by_arrival(
    received: CameraFrames, exposures: list[Exposure]
) -> tuple[list[Pair], list[Fault]]:
    start = (
        received.trigger_times[0].at_host_ns - received.trigger_times[0].uncertainty_us * NS_PER_US
    )
    ordered = sorted(exposures, key=lambda e: e.frame.arrived_host_ns)
    early = [e for e in ordered if e.frame.arrived_host_ns < start]
    rest = [e for e in ordered if e.frame.arrived_host_ns >= start]
    extra = len(rest) - len(received.trigger_times)
    if len(early) >= STRAYS_OF_A_FREE_RUN or extra >= STRAYS_OF_A_FREE_RUN:
        return [], [_free_running(received, len(early) + max(extra, 0)), *_missing(received, [])]
    faults = [
        Fault(
            FaultKind.EXTRA_AT_START,
            f"{received.camera}: a picture that came before the first shot is left out",
            received.camera,
        )
        for _ in early
    ]
    problem = _order_problem(received, rest)
    if problem is not None:
        return [], [*faults, problem]
    pairs = [
        Pair(trigger_time.shot, e.frame, Method.ARRIVAL)
        for trigger_time, e in zip(received.trigger_times, rest, strict=True)
    ]
    return pairs, faults


def _order_problem(received: CameraFrames, rest: Sequence[Exposure]) -> Fault | None:
    """Why the pictures cannot be given to the shots in the order they came in, or None."""
    wanted = len(received.trigger_times)
    if len(rest) < wanted:
        shot = received.trigger_times[0].shot if wanted == 1 else None
        which = "" if wanted == 1 else "; which shots lack theirs cannot be told"
        text = f"{received.camera}: {len(rest)} of {wanted} pictures came{which}"
        return Fault(FaultKind.MISSING, text, received.camera, shot)
    if len(rest) > wanted:
        text = (
            f"{received.camera}: {len(rest)} pictures came for {wanted} "
            f"{'shot' if wanted == 1 else 'shots'}; none is taken. No shot asked for the others: "
            "look whether the camera runs freely, at its trigger mode and its cable"
        )
        return Fault(FaultKind.AMBIGUOUS, text, received.camera)
    for trigger_time, e in zip(received.trigger_times, rest, strict=True):
        if (
            e.frame.arrived_host_ns
            < trigger_time.at_host_ns - trigger_time.uncertainty_us * NS_PER_US
        ):
            shot = trigger_time.shot
            text = f"{received.camera}: picture {shot} came before shot {shot}"
            return Fault(FaultKind.AMBIGUOUS, text, received.camera, shot)
    counters = [e.frame.counter for e in rest]
    for first, second in pairwise(counters):
        if first is not None and second is not None:
            ahead = steps(received.capabilities, first, second)
            if ahead != 1:
                text = f"{received.camera}: the frame counter goes from {first} to {second}"
                return Fault(FaultKind.AMBIGUOUS, f"{text}; no picture is taken", received.camera)
    return None


def _of_status(received: CameraFrames, one: Pair) -> list[Fault]:
    if one.frame.status is FrameStatus.LATE or _arrived_late(received, one):
        text = f"{received.camera}: the picture of shot {one.shot} came after its deadline"
        return [Fault(FaultKind.LATE, text, received.camera, one.shot)]
    if one.frame.status is FrameStatus.INCOMPLETE:
        text = f"{received.camera}: part of the picture of shot {one.shot} is missing"
        return [Fault(FaultKind.INCOMPLETE, text, received.camera, one.shot)]
    return []


def _arrived_late(received: CameraFrames, one: Pair) -> bool:
    trigger_time = next(i for i in received.trigger_times if i.shot == one.shot)
    return one.frame.arrived_host_ns - trigger_time.at_host_ns > received.deadline_s * 1e9
