"""One camera's part between FIRE and its last picture, on that camera's own thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from geometry.errors import DeviceError
from rig.cameras.base import CameraDevice, ClockSample, Frame, TimestampKind, TriggerKind
from rig.capture.instants import Bracket

CLOCK_READINGS = 8
SLICE_S = 0.1
"""How often a camera that waits looks whether it is still wanted."""


@dataclass(frozen=True, eq=False)
class Want:
    """What is wanted of one camera. Times are from ``start``, which is set just before FIRE.

    ``first_s``: when the first shot is; ``deadline_s``: when the last picture must be there.
    ``pictures``: how many are waited for, fewer than ``shots`` once a burst is known to have been
    stopped.
    """

    shots: int
    pictures: Callable[[], int]
    interval_s: float
    first_s: float
    deadline_s: float
    settle_s: float
    start: threading.Event
    give_up: threading.Event


@dataclass(frozen=True, eq=False)
class Collected:
    """What a camera gave. ``sent``: when it was told over its bus, shot by shot."""

    frames: tuple[Frame, ...] = ()
    sent: tuple[Bracket, ...] = ()
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
    began = time.monotonic()
    sent: tuple[Bracket, ...] = ()
    frames: tuple[Frame, ...] = ()
    samples: tuple[ClockSample, ...] = ()
    try:
        if device.capabilities.trigger is TriggerKind.SOFTWARE:
            sent = _command(device, want, began)
        frames = _wait(device, want, began)
        samples = read_clock(device)
    except DeviceError as error:
        return Collected(frames, sent, samples, error.problem)
    return Collected(frames, sent, samples, device.health().problem)


def _command(device: CameraDevice, want: Want, began: float) -> tuple[Bracket, ...]:
    sent = []
    for k in range(want.shots):
        due = began + want.first_s + k * want.interval_s
        if want.give_up.wait(max(0.0, due - time.monotonic())):
            break
        before = time.monotonic_ns()
        device.software_trigger()
        sent.append(Bracket(before, time.monotonic_ns()))
    return tuple(sent)


def _wait(device: CameraDevice, want: Want, began: float) -> tuple[Frame, ...]:
    frames: tuple[Frame, ...] = ()
    until = began + want.deadline_s
    while len(frames) < want.pictures() and not want.give_up.is_set():
        left = until - time.monotonic()
        if left <= 0.0:
            return frames
        frames = tuple(device.wait_frames(want.pictures(), min(SLICE_S, left)))
        if len(frames) < want.pictures() and not device.health().connected:
            return frames
    if want.give_up.is_set():
        return frames
    # One more than wanted: returns at once when a picture turns up that nobody asked for.
    return tuple(device.wait_frames(len(frames) + 1, want.settle_s))
