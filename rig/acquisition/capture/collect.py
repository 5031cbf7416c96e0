"""One camera's part between FIRE and its last picture, on that camera's own thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from common.errors import DeviceError
from rig.acquisition.cameras.base import (
    CameraDevice,
    ClockSample,
    Frame,
    TimestampKind,
    TriggerKind,
)
from rig.acquisition.synchrony.imagechecks import is_raw
from rig.acquisition.synchrony.triggertimes import HostInterval

CLOCK_READINGS = 8
SLICE_S = 0.1
"""How often a camera that waits looks whether it is still wanted."""


@dataclass(frozen=True, eq=False)
class Want:
    """What is wanted of one camera. Times are from ``start``, which is set just before FIRE.

    ``first_s``: when the first shot is; ``deadline_s``: when the last picture must be there.
    ``pictures``: how many are waited for, fewer than ``shots`` once a burst is known to have been
    stopped. ``ready_stamp``: what the camera's clock said when it was ready.
    """

    shots: int
    pictures: Callable[[], int]
    interval_s: float
    first_s: float
    deadline_s: float
    settle_s: float
    start: threading.Event
    give_up: threading.Event
    ready_stamp: int | None = None


@dataclass(frozen=True, eq=False)
class Collected:
    """What a camera gave. ``sent``: when it was told over its bus, shot by shot."""

    frames: tuple[Frame, ...] = ()
    sent: tuple[HostInterval, ...] = ()
    clock_samples: tuple[ClockSample, ...] = ()
    problem: str = ""


def read_clock(device: CameraDevice) -> tuple[ClockSample, ...]:
    """Readings of a camera's clock, none where it has no clock of its own."""
    if device.capabilities.timestamps not in (TimestampKind.DEVICE, TimestampKind.PTP):
        return ()
    return tuple(device.clock_samples(CLOCK_READINGS))


def collect(device: CameraDevice, want: Want) -> Collected:
    """Trigger the camera where that is the host's part, and wait for its pictures."""
    want.start.wait()
    began, start_ns = time.monotonic(), time.monotonic_ns()
    sent: tuple[HostInterval, ...] = ()
    frames: tuple[Frame, ...] = ()
    samples: tuple[ClockSample, ...] = ()
    try:
        if device.capabilities.trigger is TriggerKind.SOFTWARE:
            sent = _command(device, want, began)
        frames = _wait(device, want, began, start_ns)
        samples = read_clock(device)
    except DeviceError as error:
        return Collected(frames, sent, samples, error.problem)
    return Collected(frames, sent, samples, device.health().problem)


def _command(device: CameraDevice, want: Want, began: float) -> tuple[HostInterval, ...]:
    sent = []
    for k in range(want.shots):
        due = began + want.first_s + k * want.interval_s
        if want.give_up.wait(max(0.0, due - time.monotonic())):
            break
        before = time.monotonic_ns()
        device.software_trigger()
        sent.append(HostInterval(before, time.monotonic_ns()))
    return tuple(sent)


def _wait(device: CameraDevice, want: Want, began: float, start_ns: int) -> tuple[Frame, ...]:
    frames: tuple[Frame, ...] = ()
    until = began + want.deadline_s
    while wanted(frames, want, start_ns) < want.pictures() and not want.give_up.is_set():
        left = until - time.monotonic()
        if left <= 0.0:
            return frames
        # More than there are, beside those that do not count: one more ends the wait.
        others = len(frames) - wanted(frames, want, start_ns)
        count = max(want.pictures() + others, 1)
        frames = tuple(device.wait_frames(count, min(SLICE_S, left)))
        if not device.health().connected:
            return frames
    if want.give_up.is_set():
        return frames
    # One more than wanted: returns at once when a picture turns up that nobody asked for.
    return tuple(device.wait_frames(len(frames) + 1, want.settle_s))


def wanted(frames: Sequence[Frame], want: Want, start_ns: int) -> int:
    """How many of the pictures can be of this capture's shots.

    Copies count once, and what was there or exposed before FIRE not at all: else the wait would
    end before the last true picture has come. Of bodies that make two files per shot the kind
    counts of which there are more.
    """
    seen: dict[bool, set[tuple[int | None, ...]]] = {False: set(), True: set()}
    for k, frame in enumerate(frames):
        stale = frame.arrived_host_ns < start_ns
        if want.ready_stamp is not None and frame.device_ns is not None:
            stale |= frame.device_ns < want.ready_stamp
        if not stale:
            known = frame.counter is not None or frame.device_ns is not None
            seen[is_raw(frame)].add((frame.counter, frame.device_ns) if known else (k,))
    return max(map(len, seen.values()))
