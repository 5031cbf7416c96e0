"""Cameras held by worker processes: what all backends behind a library share.

A library that hangs or crashes takes one process with it, never the host, and every command has
a deadline of ours instead of the library's. Vendors' libraries do both.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from geometry.errors import DeviceError, InputError
from rig.cameras import pixels
from rig.cameras.base import (
    ArmSpec,
    CameraCapabilities,
    CameraHealth,
    CameraInfo,
    CameraSettings,
    ClockSample,
    Frame,
    FrameStatus,
    Image,
    TimestampKind,
    TriggerKind,
)
from rig.cameras.link import LinkDown, LinkSilent, WorkerLink
from rig.cameras.workers import wire

logger = logging.getLogger(__name__)

SPARE_FRAMES = 16
"""Frames kept beyond those asked for; a camera that runs freely must not fill the memory."""
PING_S = 1.0


@dataclass(frozen=True)
class WorkerSpec:
    """How the worker of a backend is started. Deadlines in seconds.

    ``driver`` is ``package.module:Class``; ``options`` go to it as they are.
    """

    backend: str
    driver: str
    interpreter: str
    options: Mapping[str, object]
    environment: Mapping[str, str] = field(default_factory=dict)
    hints: Mapping[str, object] = field(default_factory=dict)
    """Options that help to find the camera when it is first opened; later they may mislead."""
    open_deadline_s: float = 15.0
    command_deadline_s: float = 2.0


class RemoteCamera:
    """One camera in a worker process of its own; a :class:`~rig.cameras.base.CameraDevice`.

    When the worker does not answer in time it is ended and the camera counts as gone. The next
    :meth:`configure` or :meth:`arm` starts another one and restores the settings.
    """

    def __init__(self, spec: WorkerSpec, camera_id: str) -> None:
        self._spec = spec
        self._id = camera_id
        self._link: WorkerLink | None = None
        self._commands = threading.RLock()
        self._news = threading.Condition()
        self._frames: list[Frame] = []
        self._arm_number = 0
        self._armed: ArmSpec | None = None
        self._waited = True
        self._fired_ns = 0
        self._problem = ""
        """Why the worker is of no use any more; it is replaced at the next command."""
        self._silence = ""
        """What the last look at its health waited for in vain; a later look may be luckier."""
        self._note = ""
        """What is wrong with a camera that still answers."""
        self._closed = False
        self._settings = CameraSettings()
        self._counts: Counter[str] = Counter()
        self._library_counts: Mapping[str, int] = {}
        self._info, self._capabilities = self._start(spec.hints)

    @property
    def info(self) -> CameraInfo:
        """Which camera this is."""
        return self._info

    @property
    def capabilities(self) -> CameraCapabilities:
        """What it can do."""
        return self._capabilities

    @property
    def worker_pid(self) -> int | None:
        """Process id of the worker, None while there is none."""
        link = self._link
        return link.pid if link else None

    def _start(self, hints: Mapping[str, object]) -> tuple[CameraInfo, CameraCapabilities]:
        spec = self._spec
        link = WorkerLink(
            spec.interpreter, spec.driver, spec.environment, self._on_message, self._on_end
        )
        try:
            args = {"id": self._id, "options": {**spec.options, **hints}}
            told = link.ask("open", args, spec.open_deadline_s)
        except LinkDown as error:
            link.kill()
            raise self._gone(str(error)) from None
        except BaseException as error:
            link.kill()
            if isinstance(error, DeviceError) and error.detail == "camera-gone":
                raise self._gone(error.problem) from None
            raise
        self._link, self._problem, self._silence = link, "", ""
        return read_info(spec.backend, told["info"]), read_capabilities(told["capabilities"])

    def _gone(self, why: str) -> DeviceError:
        return DeviceError(
            "camera-gone",
            f"camera {self._id} ({self._spec.backend}) is gone: {why}",
            "check its power and cable; it is opened again by the next arm or configure",
        )

    def _lose(self, why: str) -> None:
        link, self._link = self._link, None
        with self._news:
            self._problem = self._problem or why
            self._news.notify_all()
        if link is not None:
            logger.warning("camera %s lost: %s", self._id, why)
            self._counts["lost"] += 1
            link.kill()

    def _on_end(self, reason: str) -> None:
        with self._news:
            if self._link is not None and not self._closed:
                self._problem = self._problem or reason
            self._news.notify_all()

    def _on_message(self, header: wire.Header, payload: bytes) -> None:
        arrived_ns = time.monotonic_ns()
        if "failed" in header:
            self._complain(header["failed"])
            return
        told = header.get("frame", {})
        with self._news:
            current = told.get("arm") == self._arm_number
            fired_ns = self._fired_ns
        if not current:
            self._counts["stale_frames"] += 1
            return
        frame = self._read_frame(told, payload, arrived_ns, fired_ns)
        with self._news:
            self._keep(frame)
            self._news.notify_all()

    def _complain(self, spelt: Mapping[str, str]) -> None:
        with self._news:
            if spelt.get("detail") in ("camera-gone", "camera-error"):
                self._problem = self._problem or spelt["problem"]
            else:
                self._note = spelt["problem"]
            self._news.notify_all()

    def _keep(self, frame: Frame) -> None:
        self._counts["frames"] += 1
        if frame.status is not FrameStatus.OK:
            self._counts[f"{frame.status}_frames"] += 1
        self._frames.append(frame)
        shots = self._armed.shots if self._armed else 0
        if len(self._frames) > shots + SPARE_FRAMES:
            del self._frames[0]
            self._counts["overrun_frames"] += 1

    def _read_frame(
        self, told: Mapping[str, Any], payload: bytes, arrived_ns: int, fired_ns: int
    ) -> Frame:
        arrived_ns = int(told.get("arrived_host_ns", arrived_ns))
        status = FrameStatus(told.get("status", "ok"))
        spec = self._armed
        if status is FrameStatus.OK and spec and fired_ns:
            late = (arrived_ns - fired_ns) / 1e9 > spec.deadline_s
            status = FrameStatus.LATE if late else status
        picture: dict[str, Any] = {}
        notes = dict(told.get("metadata", {}))
        if told.get("media_type"):
            picture = {"encoded": payload, "media_type": told["media_type"]}
        else:
            try:
                picture = {"pixels": _decode(told, payload)}
            except ValueError as error:
                status, notes["problem"] = FrameStatus.INCOMPLETE, str(error)
        return Frame(
            camera_id=self._info.id,
            arrived_host_ns=arrived_ns,
            status=status,
            counter=told.get("counter"),
            device_ns=told.get("device_ns"),
            exposure_us=told.get("exposure_us"),
            metadata=notes,
            **picture,
        )

    def _ask(self, do: str, args: Mapping[str, object] | None = None) -> Any:  # noqa: ANN401
        link = self._link
        if self._closed or link is None:
            raise self._gone("it was closed" if self._closed else self._problem)
        try:
            return link.ask(do, args or {}, self._spec.command_deadline_s)
        except LinkDown as error:
            self._lose(str(error))
            raise self._gone(str(error)) from None
        except DeviceError as error:
            if error.detail != "camera-gone":
                raise
            self._lose(error.problem)
            raise self._gone(error.problem) from None

    def _revive(self) -> None:
        """Start again what was lost, with the settings it had."""
        doubt = self._problem or self._silence
        if self._closed or (self._link is not None and not doubt):
            return
        self._lose(doubt)
        self._info, self._capabilities = self._start({})
        self._counts["restarts"] += 1
        if self._settings != CameraSettings():
            self._configure(self._settings)

    def configure(self, settings: CameraSettings) -> CameraSettings:
        """Ask for settings; what the camera has now."""
        with self._commands:
            self._revive()
            return self._configure(settings)

    def _configure(self, settings: CameraSettings) -> CameraSettings:
        self._armed = None
        told = self._ask("configure", {"settings": asdict(settings)})
        real = CameraSettings(**told)
        wanted = {name: value for name, value in asdict(settings).items() if value is not None}
        self._settings = CameraSettings(**{**asdict(self._settings), **wanted})
        if real.pixel_format and not pixels.understood(real.pixel_format):
            raise InputError(
                "camera-setting",
                f"pixel_format: {real.pixel_format} of camera {self._id} cannot be read",
                "choose a Mono, Bayer or RGB format of up to 16 bits",
            )
        return real

    def arm(self, spec: ArmSpec) -> None:
        """Get ready; frames that came before are dropped and counted."""
        with self._commands:
            self._revive()
            with self._news:
                self._arm_number += 1
                if not self._waited:
                    self._counts["stale_frames"] += len(self._frames)
                self._frames, self._waited = [], False
                self._armed, self._fired_ns, self._note = spec, 0, ""
            try:
                args = {"number": self._arm_number, "shots": spec.shots}
                self._counts["stale_frames"] += int(self._ask("arm", args))
            except BaseException:
                self._armed = None
                raise

    def software_trigger(self) -> None:
        """Expose now."""
        if self._capabilities.trigger is not TriggerKind.SOFTWARE:
            raise InputError(
                "camera-trigger",
                f"camera {self._id} is not triggered by software",
                "set the option 'trigger' of its backend to 'software'",
            )
        with self._commands:
            if self._armed is None:
                raise DeviceError(
                    "camera-not-ready", f"camera {self._id} is not armed", "arm it first"
                )
            self._fired_ns = time.monotonic_ns()
            self._ask("trigger")

    def wait_frames(self, count: int, timeout_s: float) -> Sequence[Frame]:
        """The frames since :meth:`arm`, fewer than ``count`` when time is up or it is gone."""
        deadline = time.monotonic() + timeout_s
        link = self._link
        if link is not None:
            link.tell("collect")
        with self._news:
            while len(self._frames) < count and not (self._problem or self._note):
                left = deadline - time.monotonic()
                if left <= 0:
                    break
                self._news.wait(left)
            self._waited = True
            return tuple(self._frames)

    def disarm(self) -> None:
        """Stop waiting for triggers; nothing to do for a camera that is gone."""
        with self._commands:
            if self._armed is None:
                return
            self._armed = None
            with contextlib.suppress(DeviceError):
                self._ask("disarm")

    def clock_samples(self, count: int) -> Sequence[ClockSample]:
        """Readings of the camera's clock."""
        if self._capabilities.timestamps not in (TimestampKind.DEVICE, TimestampKind.PTP):
            return ()
        with self._commands:
            return tuple(ClockSample(*reading) for reading in self._ask("clock", {"count": count}))

    def health(self) -> CameraHealth:
        """How it is: asks the camera when no command is under way, for at most a second."""
        if self._commands.acquire(timeout=0.01):
            try:
                self._ping()
            finally:
                self._commands.release()
        with self._news:
            gone = "it was closed" if self._closed else self._problem or self._silence
            return CameraHealth(
                connected=not gone,
                armed=self._armed is not None and not gone,
                problem=gone or self._note,
                counters={**self._library_counts, **self._counts},
            )

    def _ping(self) -> None:
        link = self._link
        if self._closed or link is None or self._problem:
            return
        try:
            self._silence = ""
            self._library_counts = link.ask("ping", {}, PING_S)
        except LinkSilent as error:
            self._silence = str(error)
        except LinkDown as error:
            self._lose(str(error))
        except DeviceError as error:
            if error.detail == "camera-gone":
                self._lose(error.problem)
            else:
                self._note = error.problem

    def close(self) -> None:
        """Let go of it and end the worker."""
        with self._commands:
            if self._closed:
                return
            self._closed, self._armed = True, None
            link, self._link = self._link, None
            if link is not None:
                link.close()


def _decode(told: Mapping[str, Any], payload: bytes) -> Image:
    if not {"pixel_format", "width", "height"} <= told.keys():
        raise ValueError("the frame says neither its size nor its format")
    return pixels.decode(told["pixel_format"], told["width"], told["height"], payload)


def read_info(backend: str, told: Mapping[str, str]) -> CameraInfo:
    """A camera as its worker describes it."""
    names = ("id", "model", "vendor", "address")
    return CameraInfo(backend=backend, **{name: told.get(name, "") for name in names})


def read_capabilities(told: Mapping[str, Any]) -> CameraCapabilities:
    """Capabilities as a worker tells them."""
    return CameraCapabilities(
        **{
            **told,
            "trigger": TriggerKind(told["trigger"]),
            "timestamps": TimestampKind(told["timestamps"]),
            "settable": frozenset(told["settable"]),
        }
    )


class RemoteBackend:
    """Finds and opens cameras through workers; a :class:`~rig.cameras.base.CameraBackend`."""

    def __init__(self, spec: WorkerSpec) -> None:
        self._spec = spec
        self._open: dict[str, RemoteCamera] = {}
        self._books = threading.Lock()

    @property
    def name(self) -> str:
        """Its name in station files."""
        return self._spec.backend

    def discover(self) -> Sequence[CameraInfo]:
        """The cameras that can be opened now, and those that are open here."""
        held = [camera.info for camera in self._held()]
        spec = self._spec
        link = WorkerLink(
            spec.interpreter, spec.driver, spec.environment, _ignore_message, _ignore_end
        )
        try:
            args = {"options": spec.options, "skip": [info.address for info in held]}
            told = link.ask("discover", args, spec.open_deadline_s)
        except LinkDown as error:
            raise DeviceError(
                "discovery-failed",
                f"looking for {spec.backend} cameras failed: {error}",
                "check the library and its drivers, then try again",
            ) from None
        finally:
            link.close()
        found = {info.id: info for info in held}
        for one in told:
            found.setdefault(one["id"], read_info(spec.backend, one))
        return tuple(found[key] for key in sorted(found))

    def _held(self) -> list[RemoteCamera]:
        with self._books:
            self._open = {k: c for k, c in self._open.items() if c.worker_pid is not None}
            return list(self._open.values())

    def open(self, camera_id: str) -> RemoteCamera:
        """Open one by its id; it must not be open here already."""
        if any(camera.info.id == camera_id for camera in self._held()):
            raise DeviceError(
                "camera-busy", f"camera {camera_id} is open already", "close it first"
            )
        camera = RemoteCamera(self.spec_for(camera_id), camera_id)
        with self._books:
            self._open[camera_id] = camera
        return camera

    def spec_for(self, camera_id: str) -> WorkerSpec:  # noqa: ARG002  the same for all, mostly
        """How the worker of one camera is started."""
        return self._spec

    def close(self) -> None:
        """Close what is open."""
        for camera in self._held():
            camera.close()


def _ignore_message(header: wire.Header, payload: bytes) -> None:
    """Nothing but answers is expected while looking for cameras."""


def _ignore_end(reason: str) -> None:
    """The question that was asked tells of it."""
