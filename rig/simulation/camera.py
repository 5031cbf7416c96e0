"""One simulated camera; :mod:`rig.simulation.backend` makes them."""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from common.errors import DeviceError, InputError
from rig.acquisition.cameras.base import (
    ArmSpec,
    CameraCapabilities,
    CameraHealth,
    CameraInfo,
    CameraSettings,
    ClockSample,
    Frame,
    FrameStatus,
    TimestampKind,
    TriggerKind,
)
from rig.simulation.behaviour import CameraClock, Draw, camera_key, draw
from rig.simulation.frames import SETTABLE, Coming, settled
from rig.simulation.pool import RenderPool
from rig.simulation.previews import awaited
from rig.simulation.settings import SimulationSettings
from rig.simulation.studio import Shot, Triple

_BUFFERS = 32
"""Frames that the camera keeps between arming and collecting; more are lost and counted."""

_DUPLICATE_NS = 5_000_000
_TICK_S = 0.05
_COUNTED = ("exposures", "missed_triggers", "lost_frames", "stale_frames")


@dataclass(frozen=True)
class Triggered:
    """What makes a camera expose, in instants of the host's clock.

    ``origin_ns``: when the head is in its place, None for a camera that runs freely;
    ``board_zero_ns``: when the timing board's counter started, None if it runs freely;
    ``capture`` counts the captures.
    """

    at_host_ns: int
    origin_ns: int | None
    board_zero_ns: int | None = None
    capture: int = 0


class SimulatedCamera:
    """See :class:`rig.acquisition.cameras.base.CameraDevice`, whose errors it raises.

    ``unplugged`` is told when the camera goes, ``origin`` asked when the head is in its place.
    A camera opened anew goes on where ``former`` left off: its clock and counter do not start
    again because a program did.
    """

    def __init__(
        self,
        info: CameraInfo,
        settings: SimulationSettings,
        f_number: float,
        pool: RenderPool,
        clock: Callable[[], int],
        unplugged: Callable[[str], None],
        origin: Callable[[str, int], int],
        former: SimulatedCamera | None = None,
    ) -> None:
        self._info, self._simulation, self._pool = info, settings, pool
        self._clock, self._unplugged, self._origin = clock, unplugged, origin
        self._faults = settings.faults_of(info.id)
        self._seed = (settings.seed, camera_key(info.id))
        self._changed = threading.Condition()
        self._coming: list[Coming] = []
        self._seen: set[int] = set()
        self._spec: ArmSpec | None = None
        self._armed_ns = 0
        self._busy_until_ns = 0
        self._free_runs = self._previews = self._capture = 0
        self._counts = Counter(dict.fromkeys(_COUNTED, 0))
        self._gone = False
        self.closed = False
        self._settings = CameraSettings(
            settings.exposure_us, settings.gain_db, None, f_number, settings.pixel_format
        )
        if former is None:
            self._clock_own = CameraClock.drawn(self._seed, clock(), settings.clock_drift_ppm)
            self._number, self._counter = 0, settings.counter_start
        else:
            self._clock_own = former._clock_own
            self._number, self._counter = former._number, former._counter

    @property
    def info(self) -> CameraInfo:
        """Which camera this is."""
        return self._info

    @property
    def capabilities(self) -> CameraCapabilities:
        """What it can do."""
        limit_s = self._simulation.render_limit_s
        return CameraCapabilities(
            TriggerKind(self._simulation.trigger),
            TimestampKind.DEVICE,
            frame_counter=True,
            frame_counter_modulus=self._simulation.counter_modulus,
            settable=SETTABLE,
            wait_overrun_s=math.inf if limit_s is None else limit_s,
            previews=True,
        )

    def configure(self, settings: CameraSettings) -> CameraSettings:
        """Take settings; exposures are of whole microseconds, gain of tenths of a decibel."""
        self._answer()
        with self._changed:
            self._settings = settled(self._info.id, self._settings, settings)
            return self._settings

    def arm(self, spec: ArmSpec) -> None:
        """Get ready; the next edge makes a frame."""
        self._answer()
        with self._changed:
            now = self._clock()
            # What is still on its way will arrive after arming, as with real cameras.
            self._forget([c for c in self._coming if c.arrives_ns <= now])
            self._spec, self._armed_ns, self._free_runs = spec, now, 0
            if self._faults.extra_frame_at_start:
                self._expose(Triggered(self._armed_ns, None), free=True)

    def preview(self, over: Callable[[], bool]) -> Frame | None:
        """The scene at rest, in a picture of few pixels."""
        self._answer()
        with self._changed:
            if self._spec is not None or over():
                return None
            self._previews += 1
            now = self._clock()
            # Numbers of captures begin with 1: their noise is never that of a live picture.
            shot = self._shot((0, self._previews), self._capture, Triggered(now, None), now)
            moved, turned = self._knock(self._number + 1)
            shot = replace(shot, preview=True, moved_mm=moved, turned_deg=turned)
        pixels = awaited(self._pool.photograph(shot), over)
        if pixels is None:
            return None
        return Frame(self._info.id, now, FrameStatus.OK, pixels, exposure_us=shot.exposure_us)

    def software_trigger(self) -> None:
        """Expose now, after the lag."""
        self._answer()
        if self._simulation.trigger != "software":
            raise InputError(
                "camera-trigger",
                f"camera {self._info.id} takes edges, not commands",
                "fire the trigger box, or set trigger to software",
            )
        with self._changed:
            spec, now = self._spec, self._clock()
        if spec is None:
            raise DeviceError(
                "camera-not-ready", f"camera {self._info.id} is not armed", "arm it first"
            )
        self._take(Triggered(now, self._origin(spec.capture_id, now)))

    def triggered(self, trigger: Triggered) -> None:
        """An edge on the camera's line. Nothing happens unless it came after arming."""
        if self._simulation.trigger == "edge" and not self._faults.free_running:
            self._take(trigger)

    def wait_frames(self, count: int, timeout_s: float) -> Sequence[Frame]:
        """The frames since arming; see the module for what the timeout means."""
        until = self._clock() + round(timeout_s * 1e9)
        with self._changed:
            while True:
                if self.closed:
                    self._answer()
                now = self._clock()
                self._run_freely(min(now, until))
                arrived = [c for c in self._coming if c.arrives_ns <= min(now, until)]
                # Nothing more will come from a camera that is gone, but what has come is whole.
                if len(arrived) >= count or now >= until or self._gone:
                    break
                ahead = [c.arrives_ns for c in self._coming if c.arrives_ns > now]
                wait_s = (min([until, *ahead]) - now) * 1e-9
                self._changed.wait(min(max(wait_s, 1e-4), _TICK_S))
        limit_s = self._simulation.render_limit_s
        ready = sorted(self._with_meanwhile(arrived), key=lambda c: c.arrives_ns)
        with self._changed:
            self._seen.update(map(id, ready))
        return tuple(coming.developed(limit_s) for coming in ready)

    def disarm(self) -> None:
        """Take no more triggers."""
        with self._changed:
            self._spec = None
            self._changed.notify_all()

    def clock_samples(self, count: int) -> Sequence[ClockSample]:
        """Readings of the camera's own clock."""
        self._answer()
        samples = []
        for _ in range(count):
            before = self._clock()
            own = self._clock_own.at(self._clock())
            samples.append(ClockSample(before, own, self._clock()))
        return tuple(samples)

    def health(self) -> CameraHealth:
        """How it is."""
        problem = f"camera {self._info.id} does not answer; plug it in again" if self._gone else ""
        connected = not (self._gone or self.closed)
        return CameraHealth(
            connected, connected and self._spec is not None, problem, dict(self._counts)
        )

    def close(self) -> None:
        """Let go of it."""
        with self._changed:
            self.closed = True
            self._spec = None
            self._forget(list(self._coming))
            self._changed.notify_all()

    def _answer(self) -> None:
        if self._gone or self.closed:
            raise DeviceError(
                "camera-gone",
                f"camera {self._info.id} does not answer",
                "plug it in and open it again",
            )

    def _forget(self, those: list[Coming]) -> None:
        """Drop frames; those that nobody has collected are counted. The lock is held."""
        for coming in those:
            coming.picture.cancel()
            self._coming.remove(coming)
            self._counts["stale_frames"] += id(coming) not in self._seen
            self._seen.discard(id(coming))

    def _take(self, trigger: Triggered) -> None:
        with self._changed:
            if self._spec is None or trigger.at_host_ns < self._armed_ns or self.closed:
                return
            self._expose(trigger, free=False)
            self._changed.notify_all()

    def _run_freely(self, until_ns: int) -> None:
        """Make the frames that a camera without a trigger cable has made by now."""
        if not self._faults.free_running or self._spec is None:
            return
        interval = round(self._faults.free_run_interval_ms * 1e6)
        while self._armed_ns + (self._free_runs + 1) * interval <= until_ns:
            self._free_runs += 1
            self._expose(Triggered(self._armed_ns + self._free_runs * interval, None), free=True)

    def _expose(self, trigger: Triggered, *, free: bool) -> None:
        """One exposure from trigger to frame. The lock is held."""
        spec, faults = self._spec, self._faults
        if spec is None or self._gone:
            return
        self._number += 1
        lot = draw(faults, self._seed, self._number)
        start = trigger.at_host_ns + (0 if free else round(lot.lag_us * 1e3))
        if self._number == faults.unplug_at_shot:
            self._gone = True
            self._unplugged(self._info.id)
            self._changed.notify_all()
            return
        if self._number == faults.timestamp_reset_at_shot:
            self._clock_own = self._clock_own.reset_at(start - 1_000_000)
        if "miss" in lot.faults or start < self._busy_until_ns:
            self._counts["missed_triggers"] += 1
            return
        self._counter = (self._counter + 1) % self._simulation.counter_modulus
        self._counts["exposures"] += 1
        self._busy_until_ns = start + round((self._settings.exposure_us or 0.0) * 1e3)
        if "drop" in lot.faults or len(self._coming) >= _BUFFERS:
            self._counts["lost_frames"] += 1
            return
        self._send(spec, trigger, lot, start, free)

    def _send(self, spec: ArmSpec, trigger: Triggered, lot: Draw, start: int, free: bool) -> None:
        """Order the picture and put the frame on its way."""
        held_ms = self._simulation.readout_ms
        held_ms += self._faults.late_ms if "late" in lot.faults else 0.0
        arrives = self._busy_until_ns + round(held_ms * 1e6)
        late = not free and arrives > trigger.at_host_ns + round(spec.deadline_s * 1e9)
        frame = Frame(
            self._info.id,
            arrives,
            FrameStatus.LATE if late else FrameStatus.OK,
            counter=self._counter,
            device_ns=self._clock_own.at(start),
            exposure_us=self._settings.exposure_us,
            metadata={"pixel_format": self._settings.pixel_format or ""},
        )
        # Within a session the number of the capture counts, because exposures are counted anew by
        # each program: pictures of one session would share their noise, and held things a place.
        numbers = (self._number, spec.number) if spec.number else (self._number,)
        self._capture = spec.number or trigger.capture
        shot = self._shot(numbers, self._capture, trigger, start)
        picture = self._pool.photograph(replace(shot, black="black" in lot.faults))
        limits = (late, not free)
        self._coming.append(Coming(frame, picture, lot.faults, *limits))
        if "duplicate" in lot.faults:
            again = replace(frame, arrived_host_ns=arrives + _DUPLICATE_NS)
            self._coming.append(Coming(again, picture, lot.faults, *limits))

    def _shot(self, numbers: tuple[int, ...], capture: int, trigger: Triggered, start: int) -> Shot:
        settings = self._settings
        moved, turned = self._knock(self._number)
        since = start if trigger.origin_ns is None else trigger.origin_ns
        board = self._simulation.scene.board
        board_ns = start - (trigger.board_zero_ns or 0)
        if board is not None:
            board_ns %= round(board.board.range_us * 1e3)
        return Shot(
            self._info.id,
            settings.exposure_us or 0.0,
            settings.gain_db or 0.0,
            settings.f_number,
            settings.pixel_format or "RGB8",
            (start - since) * 1e-9,
            board_ns * 1e-3,
            (*self._seed, *numbers),
            capture=capture,
            moved_mm=moved,
            turned_deg=turned,
        )

    def _knock(self, number: int) -> tuple[Triple, Triple]:
        """How far the camera is from its place at an exposure, and how it is turned."""
        if not self._faults.knocked(number):
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        return self._faults.moved_mm, self._faults.turned_deg

    def _with_meanwhile(self, arrived: list[Coming]) -> list[Coming]:
        """Wait for the pictures of frames that have arrived, and of those that came meanwhile.

        A caller that gives up by its own clock while a picture is rendered would lose the later
        frames of a burst, which came in time; so they are handed over too.
        """
        known = list(arrived)
        while True:
            for coming in known:
                coming.rendered(self._simulation.render_limit_s)
            with self._changed:
                now = self._clock()
                more = [
                    c
                    for c in self._coming
                    if c not in known and c.triggered and not c.late and c.arrives_ns <= now
                ]
            if not more or not known:
                return known
            known += more
