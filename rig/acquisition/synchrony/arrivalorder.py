"""Pictures given to shots by the order in which they came: a last resort, and said to be one."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, takewhile

from rig.acquisition.synchrony.cameraframes import CameraFrames, Method, Pair
from rig.acquisition.synchrony.clocks import NS_PER_US, TriggerTime
from rig.acquisition.synchrony.counters import steps
from rig.acquisition.synchrony.exposures import Exposure, Hits
from rig.acquisition.synchrony.faults import Fault, FaultKind

STRAYS_OF_A_FREE_RUN = 2
"""One picture nobody asked for happens (some cameras give one when armed); two do not."""


def by_arrival(received: CameraFrames, exposures: list[Exposure]) -> tuple[list[Pair], list[Fault]]:
    """The pairs and the faults of a camera whose stamps are of no use."""
    start = _earliest_ns(received.trigger_times[0])
    ordered = sorted(exposures, key=lambda e: e.frame.arrived_host_ns)
    early = [e for e in ordered if e.frame.arrived_host_ns < start]
    rest = [e for e in ordered if e.frame.arrived_host_ns >= start]
    extra = len(rest) - len(received.trigger_times)
    if len(early) >= STRAYS_OF_A_FREE_RUN or extra >= STRAYS_OF_A_FREE_RUN:
        return [], [free_running(received, len(early) + max(extra, 0)), *missing(received, [])]
    faults = [
        Fault(
            FaultKind.EXTRA_AT_START,
            f"{received.camera}: a picture that came before the first shot is left out",
            received.camera,
        )
        for _ in early
    ]
    given = len(rest) if extra >= 0 else _certain(received, rest)
    problem = _order_problem(received, rest[:given])
    if problem is not None:
        return [], [*faults, problem]
    pairs = [
        Pair(trigger_time.shot, e.frame, Method.ARRIVAL)
        for trigger_time, e in zip(received.trigger_times, rest[:given], strict=False)
    ]
    if given == len(rest):
        return pairs, [*faults, *missing(received, pairs)]
    after = f"after shot {received.trigger_times[given - 1].shot} it" if given else "it"
    text = (
        f"{received.camera}: {len(rest)} of {len(received.trigger_times)} pictures came; "
        f"{after} cannot be told which shots lack theirs"
    )
    return pairs, [*faults, Fault(FaultKind.MISSING, text, received.camera)]


def _certain(received: CameraFrames, rest: Sequence[Exposure]) -> int:
    """How many of too few pictures came before the shot after theirs, so that they are certain."""
    # Of a picture of the last shot that can be said only where none is lacking.
    pictures = zip(rest, received.trigger_times[1:], strict=False)
    certain = takewhile(lambda one: one[0].frame.arrived_host_ns < _earliest_ns(one[1]), pictures)
    return sum(1 for _ in certain)


def _earliest_ns(trigger_time: TriggerTime) -> float:
    return trigger_time.at_host_ns - trigger_time.uncertainty_us * NS_PER_US


def _order_problem(received: CameraFrames, rest: Sequence[Exposure]) -> Fault | None:
    """Why the pictures cannot be given to the shots in the order they came in, or None."""
    wanted = len(received.trigger_times)
    if len(rest) > wanted:
        text = (
            f"{received.camera}: {len(rest)} pictures came for {wanted} "
            f"{'shot' if wanted == 1 else 'shots'}; none is taken. No shot asked for the others: "
            "look whether the camera runs freely, at its trigger mode and its cable"
        )
        return Fault(FaultKind.AMBIGUOUS, text, received.camera)
    for trigger_time, e in zip(received.trigger_times, rest, strict=False):
        if e.frame.arrived_host_ns < _earliest_ns(trigger_time):
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


def free_running(received: CameraFrames, count: int) -> Fault:
    """The fault of a camera that makes pictures by itself."""
    return Fault(
        FaultKind.FREE_RUNNING,
        f"{received.camera}: {count} pictures were made that no shot asked for: it is not "
        "triggered from outside; check its trigger cable and trigger mode",
        received.camera,
    )


def missing(received: CameraFrames, pairs: Sequence[Pair], hits: Hits | None = None) -> list[Fault]:
    """A fault for each shot that has no picture and no candidate for one (``hits``)."""
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
