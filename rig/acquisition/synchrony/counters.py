"""Frame counters: how far apart two of them are, and what they say against time stamps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from rig.acquisition.cameras.base import CameraCapabilities
from rig.acquisition.synchrony.cameraframes import CameraFrames, Pair
from rig.acquisition.synchrony.faults import Fault, FaultKind


def steps(capabilities: CameraCapabilities, first: int, second: int) -> int:
    """How many exposures lie between two counter values; 0 or less: not in this order.

    The modulus counts the counter's values, so one that skips zero and has 65535 of them goes
    from 65535 to 1. Of the two ways round the circle the shorter is meant.
    """
    period = capabilities.frame_counter_modulus
    if period is None:
        return second - first
    ahead = (second - first) % period
    return ahead if ahead <= period // 2 else ahead - period


def counter_faults(
    received: CameraFrames, pairs: Sequence[Pair], exposures: Sequence[int | None]
) -> list[Fault]:
    """What the counters add to pairs found by time stamps.

    ``exposures``: the counters of all distinct exposures in order of their time stamps, those of
    ``pairs`` among them. A conflict means that counters and stamps contradict each other in
    their order, so that one of them lies.
    """
    if not received.capabilities.frame_counter or any(c is None for c in exposures):
        return []
    values = [c for c in exposures if c is not None]
    shots = {pair.frame.counter: pair.shot for pair in pairs}
    faults = []
    for first, second in pairwise(values):
        ahead = steps(received.capabilities, first, second)
        if ahead <= 0:
            return [_conflict(received, first, second)]
        if ahead > 1:
            faults.append(_gap(received, ahead - 1, shots.get(first), shots.get(second)))
    return faults


def _conflict(received: CameraFrames, first: int, second: int) -> Fault:
    return Fault(
        FaultKind.COUNTER_CONFLICT,
        f"{received.camera}: the frame counter goes from {first} to {second} while the time "
        "stamps go forward; no picture of this camera is given to a shot",
        received.camera,
    )


def _gap(received: CameraFrames, lost: int, before: int | None, after: int | None) -> Fault:
    where = "" if before is None or after is None else f" between shots {before} and {after}"
    noun = "exposure was" if lost == 1 else "exposures were"
    return Fault(
        FaultKind.COUNTER_GAP,
        f"{received.camera}: by the frame counter {lost} {noun} made{where} and lost on the way",
        received.camera,
    )
