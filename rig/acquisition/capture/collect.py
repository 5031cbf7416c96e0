"""One camera's part between FIRE and its last picture, on that camera's own thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from common.errors import RigwrightError
from rig.acquisition.cameras.base import (
    CameraDevice,
    ClockSample,
    FileFed,
    Frame,
    TimestampKind,
    TriggerKind,
)
from rig.acquisition.synchrony.fileoutlook import FileOutlook
from rig.acquisition.synchrony.imagechecks import is_raw
from rig.acquisition.synchrony.triggertimes import HostInterval

CLOCK_READINGS = 8
SLICE_S = 0.1
"""How often a camera that waits looks whether it is still wanted."""

FETCH_INTERVAL_S = 1.0
"""Shots nearer than this leave no time to fetch a picture between them."""
FETCH_ROOM_S = 0.3
"""How long before a shot no more is asked of a body."""
FETCH_DELAY_S = 0.1
"""A shot that is told so much too late was held up by fetching the picture before it."""


@dataclass(frozen=True, eq=False)
class Want:
    """What is wanted of one camera. Times are from ``start``, which is set just before FIRE.

    ``first_s``: when the first shot is; ``deadline_s``: when the last picture must be there.
    ``pictures``: how many are waited for, fewer than ``shots`` once a burst is known to have been
    stopped. ``patience_s``: how long to wait at least once it is known that the shots were made:
    where the computer is busy, that may be later than ``deadline_s``. ``ready_stamp``: what the
    camera's clock said when it was ready. ``kinds``: media types each shot must bring.
    """

    shots: int
    pictures: Callable[[], int]
    interval_s: float
    first_s: float
    deadline_s: float
    settle_s: float
    start: threading.Event
    give_up: threading.Event
    known_s: Callable[[], float | None] = lambda: None
    """When it became known that the shots were made, in seconds of the monotonic clock."""
    patience_s: float = 0.0
    ready_stamp: int | None = None
    kinds: frozenset[str] = frozenset()
    outlook: FileOutlook | None = None
    """Which files of a camera that is only seen through them may be of these shots."""
    began_ns: int = 0
    """When ``start`` was set, in ns since 1970."""

    def likely(self, frames: Sequence[Frame]) -> Sequence[Frame]:
        """Those of ``frames`` that will not be held back."""
        if self.outlook is None:
            return frames
        step_ns = round(self.interval_s * 1e9)
        first_ns = self.began_ns + round(self.first_s * 1e9)
        return self.outlook.likely(frames, [first_ns + k * step_ns for k in range(self.shots)])


@dataclass(frozen=True)
class Command:
    """One shot that a camera was told to make over its bus. ``problem``: why the call failed."""

    shot: int
    at: HostInterval
    problem: str = ""


@dataclass(frozen=True, eq=False)
class Collected:
    """What a camera gave. ``sent``: when it was told over its bus, shot by shot.

    ``asked_ns``: when it was asked for its pictures, on the host's clock; empty where they come
    by themselves. ``between``: files that had come before a :class:`FileFed` camera was armed.
    """

    frames: tuple[Frame, ...] = ()
    between: tuple[Frame, ...] = ()
    sent: tuple[Command, ...] = ()
    clock_samples: tuple[ClockSample, ...] = ()
    asked_ns: tuple[int, ...] = ()
    problem: str = ""


def read_clock(device: CameraDevice) -> tuple[ClockSample, ...]:
    """Readings of a camera's clock, none where it has no clock of its own."""
    if device.capabilities.timestamps not in (TimestampKind.DEVICE, TimestampKind.PTP):
        return ()
    return tuple(device.clock_samples(CLOCK_READINGS))


class Collector:
    """Triggers one camera where that is the host's part, and waits for its pictures.

    :meth:`run` is for the camera's own thread; :meth:`so_far` for any: what a camera has given is
    kept, also where its library raises, hangs or dies.
    """

    def __init__(self, device: CameraDevice, want: Want) -> None:
        self._device, self._want = device, want
        self._lock = threading.Lock()
        self._got = Collected()
        self._began, self._start_ns = 0.0, 0

    def so_far(self, problem: str = "") -> Collected:
        """What came until now; ``problem`` is why no more will."""
        with self._lock:
            return replace(self._got, problem=problem or self._got.problem)

    def _keep(self, **changes: Any) -> None:  # noqa: ANN401  fields of Collected
        with self._lock:
            self._got = replace(self._got, **changes)

    def run(self) -> Collected:
        """All of it; what the library raises becomes the camera's problem."""
        self._want.start.wait()
        self._began, self._start_ns = time.monotonic(), time.monotonic_ns()
        self._want = replace(self._want, began_ns=time.time_ns())
        try:
            if self._device.capabilities.trigger is TriggerKind.SOFTWARE:
                self._command()
            self._ask()
            self._recall()
            self._wait()
            self._keep(clock_samples=read_clock(self._device))
        except RigwrightError as error:
            return self.so_far(self._said() or error.problem)
        except Exception as error:  # noqa: BLE001  a fault of one backend costs its camera only
            return self.so_far(f"its backend failed ({type(error).__name__}: {error})")
        return self.so_far(self._said() or self._device.health().problem or self._unread())

    def _recall(self) -> None:
        """What a camera that is fed by files knows of before."""
        if isinstance(self._device, FileFed):
            self._keep(between=tuple(self._device.between()))
            kinds = self._device.kinds()
            if len(kinds) > 1 and not self._want.kinds:
                # Its last exposure brought several: the others of this one come later.
                self._want = replace(self._want, kinds=kinds)

    def _unread(self) -> str:
        """What came and is no picture, where pictures lack."""
        got = self.so_far().frames
        lacks = wanted(got, self._want, self._start_ns) < self._expected()
        unread = self._device.unread() if lacks and isinstance(self._device, FileFed) else ""
        return f"what came and cannot be filed: {unread}" if unread else ""

    def _is_over(self) -> bool:
        """Whether no more can come: a folder that went may be back any moment."""
        return not (self._device.capabilities.by_files or self._device.health().connected)

    def _said(self) -> str:
        """Why a command failed: it tells more than what a camera says afterwards."""
        return next((command.problem for command in self._got.sent if command.problem), "")

    def _command(self) -> None:
        want = self._want
        fetches = want.interval_s >= FETCH_INTERVAL_S
        for k in range(want.shots):
            due = self._began + want.first_s + k * want.interval_s
            if k and fetches:
                self._fetch(k, due)
                fetches = time.monotonic() - due < FETCH_DELAY_S
            if want.give_up.wait(max(0.0, due - time.monotonic())):
                return
            before, problem = time.monotonic_ns(), ""
            try:
                self._device.software_trigger()
            except RigwrightError as error:
                # A body that could not focus may make the next shot; one that is gone says so.
                problem = error.problem
            command = Command(k + 1, HostInterval(before, time.monotonic_ns()), problem)
            self._keep(sent=(*self._got.sent, command))
            if problem and not self._device.health().connected:
                return

    def _ask(self) -> None:
        if self._device.capabilities.fetched:
            self._keep(asked_ns=(*self._got.asked_ns, time.monotonic_ns()))

    def _fetch(self, count: int, due: float) -> None:
        """Have the pictures made until now, so that they are not lost with what comes next."""
        if not self._device.capabilities.fetched:
            return
        self._ask()
        frames = tuple[Frame, ...]()
        while (left := due - FETCH_ROOM_S - time.monotonic()) > 0.0:
            there = wanted(frames, self._want, self._start_ns)
            frames = self._take(count + len(frames) - there, min(SLICE_S, left))
            enough = wanted(frames, self._want, self._start_ns) >= count
            if enough or self._want.give_up.is_set() or not self._device.health().connected:
                return

    def _expected(self) -> int:
        """Pictures to wait for: none of shots that the camera could not be told to make."""
        failed = sum(bool(command.problem) for command in self._got.sent)
        return self._want.pictures() - failed

    def _until(self) -> float:
        until, known = self._began + self._want.deadline_s, self._want.known_s()
        return until if known is None else max(until, known + self._want.patience_s)

    def _wait(self) -> None:
        want, frames = self._want, tuple[Frame, ...]()
        while not want.give_up.is_set():
            there = wanted(frames, want, self._start_ns)
            if there >= self._expected() and (frames or self._expected() > 0):
                # One more than wanted: returns at once when a picture turns up that nobody
                # asked for.
                frames = self._take(len(frames) + 1, want.settle_s)
                return
            left = self._until() - time.monotonic()
            # More than there are, beside those that do not count: one more ends the wait.
            count = max(self._expected() + len(frames) - there, 1)
            # Once more at the end: what has come must be taken, however late this thread wakes.
            frames = self._take(count, max(0.0, min(SLICE_S, left)))
            if left <= 0.0 or self._is_over():
                return

    def _take(self, count: int, timeout_s: float) -> tuple[Frame, ...]:
        frames = tuple(self._device.wait_frames(count, timeout_s))
        self._keep(frames=frames)
        return frames


def wanted(frames: Sequence[Frame], want: Want, start_ns: int) -> int:
    """How many of the pictures can be of this capture's shots.

    Copies count once, and what was there or exposed before FIRE, what the camera doubts, or what by
    its time is of another shot, not at all: else the wait would end before the last true picture
    has come. Where each shot makes files of several kinds, the kind counts of which there are
    fewest; where it is not said which, that of which there are most.
    """
    seen: dict[str, set[tuple[int | None, ...]]] = {kind: set() for kind in want.kinds}
    fresh = [frame for frame in frames if not _is_stale(frame, want, start_ns)]
    for k, frame in enumerate(want.likely(fresh)):
        known = frame.counter is not None or frame.device_ns is not None
        kind = frame.media_type if want.kinds else str(is_raw(frame))
        seen.setdefault(kind, set()).add((frame.counter, frame.device_ns) if known else (k,))
    if want.kinds:
        return min(len(seen[kind]) for kind in want.kinds)
    return max(map(len, seen.values()), default=0)


def _is_stale(frame: Frame, want: Want, start_ns: int) -> bool:
    if frame.arrived_host_ns < start_ns:
        return True
    if want.ready_stamp is not None and frame.device_ns is not None:
        return frame.device_ns < want.ready_stamp
    return not frame.metadata.keys().isdisjoint(("known_as", "unlikely", "last_written"))
