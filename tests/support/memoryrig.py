"""A box and cameras that exist in memory only: they keep the contracts, and fail by script.

Every frame carries, in ``metadata["truth"]``, the box capture and shot that made it expose, so
that a test can tell a right pairing from a wrong one.
"""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from common.errors import ConflictError, DeviceError, InterlockError
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
from rig.acquisition.station.spec import CameraPlan, CapturePolicy, Station, TriggerPlan
from rig.acquisition.trigger.box import (
    ArmRequest,
    Edge,
    FireOutcome,
    FireReport,
    TriggerCapabilities,
    TriggerHealth,
    TriggerState,
)

Listener = Callable[[str, int, int], None]
"""Capture, shot and instant of a rising edge."""


@dataclass(frozen=True)
class BoxScript:
    """How a box misbehaves. ``stop_after``: shots before a burst is stopped."""

    open_interlock: bool = False
    no_interlock: bool = False
    log: bool = True
    lost_while_firing: bool = False
    fires: bool = True
    stop_after: int | None = None
    clock_uncertainty_us: float = 5.0
    gone: bool = False


class MemoryBox:
    """A :class:`TriggerBox`; its edges reach the cameras wired to it at once."""

    def __init__(self, script: BoxScript = BoxScript()) -> None:
        self.script = script
        self.fired: list[str] = []
        self.armed: str | None = None
        self.aborts = 0
        self.closed = False
        self._requests: dict[str, ArmRequest] = {}
        self._reports: dict[str, FireReport] = {}
        self._wires: list[tuple[int, Listener]] = []
        self._listeners: list[Callable[[FireReport], None]] = []
        self._aborted = threading.Event()

    def wire(self, output: int, listener: Listener) -> None:
        """Connect a camera's trigger input to an output."""
        self._wires.append((output, listener))

    @property
    def capabilities(self) -> TriggerCapabilities:
        return TriggerCapabilities(16, 0.5, 1e7, 1e7, 10_000, True, self.script.log, True)

    def open(self) -> None:
        if self.script.gone:
            raise DeviceError("trigger-gone", "the box does not answer", "plug it in")

    def close(self) -> None:
        self.closed = True

    def health(self) -> TriggerHealth:
        state = TriggerState.ARMED if self.armed else TriggerState.READY
        closed = None if self.script.no_interlock else not self.script.open_interlock
        return TriggerHealth(
            state,
            identity="memory",
            interlock_closed=closed,
            armed_capture=self.armed,
            clock_residual_us=3.0,
        )

    def arm(self, request: ArmRequest) -> None:
        if self.armed is not None or request.capture_id in self._requests:
            raise ConflictError("armed", "the box is armed, or the id is used", "disarm it")
        self._requests[request.capture_id] = request
        self.armed = request.capture_id
        self._aborted.clear()

    def fire(self, capture_id: str) -> None:
        if self.script.open_interlock:
            raise InterlockError("open", "the interlock is open", "close it")
        if self.armed != capture_id:
            raise ConflictError("not-armed", f"{capture_id} is not armed", "arm it")
        self.armed = None
        request = self._requests[capture_id]
        if self.script.fires:
            self.fired.append(capture_id)
            self._reports[capture_id] = self._make_edges(request)
        else:
            self._reports[capture_id] = FireReport(
                capture_id, FireOutcome.NOT_FIRED, 0, request.shots
            )
        if self.script.lost_while_firing:
            self._reports[capture_id] = FireReport(
                capture_id,
                FireOutcome.UNKNOWN,
                0,
                request.shots,
                acknowledged=False,
                why="unplugged",
            )
            raise DeviceError("trigger-gone", "the box does not answer", "plug it in")

    def _make_edges(self, request: ArmRequest) -> FireReport:
        start = time.monotonic_ns() + round(request.lead_us * 1000)
        stop = self.script.stop_after
        shots = request.shots if stop is None else min(stop, request.shots)
        edges = []
        for shot in range(1, shots + 1):
            zero = start + round((shot - 1) * request.interval_us * 1000)
            for output, pulse in request.pulses.items():
                for rising, at_us in (
                    (True, pulse.delay_us),
                    (False, pulse.delay_us + pulse.width_us),
                ):
                    at = zero + round(at_us * 1000)
                    edges.append(Edge(shot, output, rising, at_us, at, 0.0))
        for edge in sorted(edges, key=lambda edge: edge.at_host_ns):
            for output, listener in self._wires:
                if edge.rising and output == edge.output:
                    listener(request.capture_id, edge.shot, edge.at_host_ns)
        return FireReport(
            request.capture_id,
            FireOutcome.FIRED if shots == request.shots else FireOutcome.PARTIAL,
            shots,
            request.shots,
            tuple(edges) if self.script.log else (),
            self.script.clock_uncertainty_us,
            why="" if shots == request.shots else "the interlock was opened",
        )

    def wait_done(self, capture_id: str, timeout_s: float) -> FireReport:
        report = self._reports[capture_id]
        last = max((edge.at_host_ns for edge in report.edges), default=0)
        while not self._aborted.is_set() and time.monotonic_ns() < last:
            time.sleep(min(0.002, timeout_s))
        for listener in list(self._listeners):
            listener(report)
        return report

    def disarm(self, capture_id: str) -> None:
        if self.armed == capture_id:
            self.armed = None

    def abort(self) -> None:
        self.aborts += 1
        self.armed = None
        self._aborted.set()

    def reset(self) -> None:
        self.abort()

    def subscribe(self, listener: Callable[[FireReport], None]) -> Callable[[], None]:
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)


@dataclass(frozen=True)
class CameraScript:
    """What a camera is like and how it misbehaves. Shots are those of one capture, from 1."""

    lag_us: float = 150.0
    jitter_us: float = 0.0
    exposure_us: float | None = 4000.0
    timestamps: TimestampKind = TimestampKind.DEVICE
    trigger: TriggerKind = TriggerKind.EDGE
    modulus: int | None = 65535
    first_counter: int = 65530
    drift_ppm: float = 20.0
    readout_s: float = 0.002
    size_px: tuple[int, int] = (64, 48)
    wired_to: int | None = None
    not_ready: str = ""
    arm_hangs_s: float = 0.0
    drop: frozenset[int] = frozenset()
    miss: frozenset[int] = frozenset()
    duplicate: frozenset[int] = frozenset()
    late: frozenset[int] = frozenset()
    black: frozenset[int] = frozenset()
    incomplete: frozenset[int] = frozenset()
    wrong_size: frozenset[int] = frozenset()
    extra_at_start: bool = False
    free_running_s: float = 0.0
    clock_reset: bool = False
    latch: bool = True
    """Whether its clock can be asked."""
    unplugged: bool = False
    raw_too: bool = False
    encoded: bytes | None = None
    refuses: frozenset[int] = frozenset()
    """Commands that raise, without a picture."""
    refuses_after: frozenset[int] = frozenset()
    """Commands that are carried out and raise."""
    dies_at: int | None = None
    """The command at which it goes for good."""
    hangs_at: int | None = None
    """The command from which nothing returns for a while."""
    previews: bool = False
    preview_s: float = 0.0
    """How long it takes to show what it sees, unless told to stop."""
    empty: frozenset[int] = frozenset()
    """Shots of which the transport lost everything but the stamps."""


class MemoryCamera:
    """A :class:`CameraDevice` with a clock and a counter of its own."""

    def __init__(self, info: CameraInfo, script: CameraScript, seed: int) -> None:
        self.script = script
        self.armed = False
        self.arms = 0
        self.closed = False
        self.gone = False
        self.settings = CameraSettings(exposure_us=script.exposure_us)
        self._info = info
        self._random = random.Random(seed)  # noqa: S311  faults, not secrets
        self._origin_ns = self._random.randrange(10**12)
        self._counter = script.first_counter
        self._frames: list[Frame] = []
        self._deadline_s = 0.0
        self._lock = threading.Lock()
        self._commands = 0
        self.configured = 0
        self.showing = 0

    @property
    def info(self) -> CameraInfo:
        return self._info

    @property
    def capabilities(self) -> CameraCapabilities:
        return CameraCapabilities(
            self.script.trigger,
            self.script.timestamps,
            True,
            self.script.modulus,
            True,
            previews=self.script.previews,
        )

    def configure(self, settings: CameraSettings) -> CameraSettings:
        self.configured += 1
        if settings.exposure_us is not None:
            self.settings = replace(self.settings, exposure_us=settings.exposure_us)
        return self.settings

    def arm(self, spec: ArmSpec) -> None:
        if self.script.arm_hangs_s:
            time.sleep(self.script.arm_hangs_s)
        if self.gone:
            raise DeviceError("camera-gone", "the camera is unplugged", "plug it in")
        if self.script.not_ready:
            raise DeviceError("camera-not-ready", self.script.not_ready, "see to it")
        self._deadline_s = spec.deadline_s
        with self._lock:
            self._frames.clear()
            self._commands = 0
            self.arms += 1
            self.armed = True
        now = time.monotonic_ns()
        if self.script.extra_at_start:
            self._expose("", 0, now + 10_000)
        if self.script.free_running_s:
            for k in range(200):
                self._expose("", 0, now + round((k + 0.5) * self.script.free_running_s * 1e9))

    def preview(self, over: Callable[[], bool]) -> Frame | None:
        assert not self.armed
        self.showing += 1
        until = time.monotonic() + self.script.preview_s
        while time.monotonic() < until:
            if over():
                return None
            time.sleep(0.001)
        return Frame(self._info.id, time.monotonic_ns(), FrameStatus.OK, self._picture(0))

    def edge(self, capture: str, shot: int, at_host_ns: int) -> None:
        """The trigger line rose."""
        if not self.armed or self.script.free_running_s:
            return
        if self.script.unplugged:
            self.gone = True
            return
        lag = self.script.lag_us + self._random.gauss(0.0, 1.0) * self.script.jitter_us
        if shot not in self.script.miss:
            self._expose(capture, shot, at_host_ns + round(lag * 1000))

    def software_trigger(self) -> None:
        self._commands += 1
        shot, script = self._commands, self.script
        if shot == script.hangs_at:
            time.sleep(3.0)
        if shot == script.dies_at:
            self.gone = True
            raise DeviceError("camera-gone", "its process ended", "plug it in")
        if shot in script.refuses:
            raise DeviceError("camera-error", "it could not focus", "see to it")
        self.edge("command", shot, time.monotonic_ns())
        if shot in script.refuses_after:
            raise DeviceError("camera-error", "no answer to 'trigger'", "see to it")

    def _expose(self, capture: str, shot: int, at_host_ns: int) -> None:
        script = self.script
        self._counter += 1
        if script.modulus is not None and self._counter > script.modulus:
            self._counter = 1
        if shot in script.drop:
            return
        exposure_us = self.settings.exposure_us or 0.0
        arrives = at_host_ns + round(exposure_us * 1000 + script.readout_s * 1e9)
        status = FrameStatus.OK
        if shot in script.late:
            arrives += round(self._deadline_s * 1e9)
        if shot in script.incomplete:
            status = FrameStatus.INCOMPLETE
        frame = Frame(
            camera_id=self._info.id,
            arrived_host_ns=arrives,
            status=status,
            pixels=None if script.encoded else self._picture(shot),
            encoded=script.encoded,
            media_type="image/jpeg" if script.encoded else "",
            counter=self._counter,
            device_ns=self._stamp(at_host_ns),
            exposure_us=self.settings.exposure_us,
            metadata={"truth": f"{capture}/{shot}"},
        )
        if shot in script.empty:
            frame = replace(frame, pixels=None, status=FrameStatus.INCOMPLETE)
        copies = 2 if shot in script.duplicate else 1
        with self._lock:
            self._frames += [frame] * copies
            if script.raw_too:
                raw = replace(
                    frame, pixels=None, encoded=b"raw" * 100, media_type="image/x-nikon-nef"
                )
                self._frames.append(raw)

    def _stamp(self, host_ns: int) -> int | None:
        if self.script.timestamps not in (TimestampKind.DEVICE, TimestampKind.PTP):
            return None
        return self._device_ns(host_ns)

    def _device_ns(self, host_ns: int) -> int:
        return round((host_ns - self._origin_ns) * (1.0 + self.script.drift_ppm * 1e-6))

    def _picture(self, shot: int) -> np.ndarray:
        width, height = self.script.size_px
        if shot in self.script.wrong_size:
            width, height = width // 2, height // 2
        if shot in self.script.black:
            return np.zeros((height, width, 3), np.uint8)
        rng = np.random.default_rng(self._random.randrange(2**32))
        return rng.integers(0, 256, (height, width, 3), np.uint8)

    def wait_frames(self, count: int, timeout_s: float) -> Sequence[Frame]:
        until = time.monotonic() + timeout_s
        while True:
            now = time.monotonic_ns()
            with self._lock:
                there = [f for f in self._frames if f.arrived_host_ns <= now]
            if len(there) >= count or time.monotonic() >= until:
                return there
            time.sleep(0.001)

    def disarm(self) -> None:
        self.armed = False

    def clock_samples(self, count: int) -> Sequence[ClockSample]:
        if self.gone:
            raise DeviceError("camera-gone", "the camera is unplugged", "plug it in")
        if self.script.timestamps is not TimestampKind.DEVICE or not self.script.latch:
            return ()
        if self.script.clock_reset and self._frames:
            self._origin_ns = time.monotonic_ns()
        samples = []
        for _ in range(count):
            before = time.monotonic_ns()
            device = self._device_ns(time.monotonic_ns())
            samples.append(ClockSample(before, device, time.monotonic_ns()))
        return samples

    def health(self) -> CameraHealth:
        return CameraHealth(not self.gone, self.armed, "it is unplugged" if self.gone else "")

    def close(self) -> None:
        self.closed = True


class MemoryBackend:
    """Cameras by id, each with its script, wired to a box."""

    def __init__(
        self, station: Station, box: MemoryBox | None, scripts: Mapping[str, CameraScript]
    ) -> None:
        self.cameras: dict[str, MemoryCamera] = {}
        self._station, self._box, self._scripts = station, box, scripts

    @property
    def name(self) -> str:
        return "memory"

    def discover(self) -> Sequence[CameraInfo]:
        return [self._info(plan) for plan in self._station.cameras]

    def _info(self, plan: CameraPlan) -> CameraInfo:
        return CameraInfo(plan.id, "memory", "M1", "Memory")

    def open(self, camera_id: str) -> MemoryCamera:
        plans = list(self._station.cameras)
        index, plan = next((k, p) for k, p in enumerate(plans) if p.id == camera_id)
        script = self._scripts.get(plan.name, CameraScript())
        if script.not_ready == "absent":
            raise DeviceError("camera-gone", "it is not plugged in", "plug it in")
        camera = MemoryCamera(self._info(plan), script, index)
        self.cameras[plan.name] = camera
        output = plan.output if script.wired_to is None else script.wired_to
        if self._box is not None and output is not None:
            self._box.wire(output, camera.edge)
        return camera

    def close(self) -> None:
        for camera in self.cameras.values():
            camera.close()


@dataclass
class MemoryDevices:
    """A :class:`~rig.acquisition.capture.devices.DeviceMaker` of all that is in this module."""

    scripts: Mapping[str, CameraScript] = field(default_factory=dict)
    box: MemoryBox = field(default_factory=MemoryBox)
    backend: MemoryBackend | None = None
    closed: bool = False

    def make_box(self, plan: TriggerPlan) -> MemoryBox:  # noqa: ARG002
        return self.box

    def make_backend(self, name: str, station: Station, box: object) -> MemoryBackend:  # noqa: ARG002
        self.backend = MemoryBackend(station, self.box if box is not None else None, self.scripts)
        return self.backend

    def camera(self, name: str) -> MemoryCamera:
        assert self.backend is not None
        return self.backend.cameras[name]

    def close(self) -> None:
        self.closed = True


@dataclass(frozen=True)
class LineFit:
    """A clock through the readings with the shortest round trips at both ends."""

    device_ns: int
    at_host_ns: int
    slope: float
    half_us: float

    def host_ns(self, device_ns: int) -> int:
        return self.at_host_ns + round((device_ns - self.device_ns) * self.slope)

    def uncertainty_us(self, device_ns: int) -> float:  # noqa: ARG002
        return self.half_us


def line_fit(samples: Sequence[ClockSample]) -> LineFit | None:
    """A clock good enough for readings that are milliseconds apart."""
    if not samples:
        return None

    def trip(sample: ClockSample) -> int:
        return sample.host_after_ns - sample.host_before_ns

    best = min(samples, key=trip)
    middle = (best.host_before_ns + best.host_after_ns) // 2
    # Crystals are right to 100 ppm, readings and pictures within a second of each other.
    return LineFit(best.device_ns, middle, 1.0, trip(best) / 2000.0 + 100.0)


def memory_station(count: int = 3, **changes: object) -> Station:
    """A station of cameras in memory, fired by outputs 1, 2, 3..."""
    cameras = tuple(
        CameraPlan(f"cam{k:02d}", "memory", f"SN{k:02d}", output=k, lag_tolerance_us=5000.0)
        for k in range(1, count + 1)
    )
    policy = CapturePolicy(
        ready_deadline_s=2.0, frame_deadline_s=0.3, settle_s=0.01, min_free_mb=0.0
    )
    values: dict[str, object] = {
        "name": "memory",
        "cameras": cameras,
        "trigger": TriggerPlan("rigwright", "memory:", lead_us=2000.0),
        "policy": policy,
    }
    return Station(**{**values, **changes})


def with_camera(station: Station, name: str, **changes: object) -> Station:
    """The station with one camera changed."""
    cameras = tuple(
        replace(camera, **changes) if camera.name == name else camera for camera in station.cameras
    )
    return replace(station, cameras=cameras)


def with_policy(station: Station, **changes: object) -> Station:
    """The station with another policy."""
    return replace(station, policy=replace(station.policy, **changes))
