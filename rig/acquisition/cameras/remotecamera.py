"""A camera held by a worker process.

A library that hangs or crashes takes one process with it, never the host, and every command has
a deadline of ours instead of the library's. Vendors' libraries do both.
"""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from common.errors import DeviceError, InputError
from rig.acquisition.cameras import pixels
from rig.acquisition.cameras.base import (
    ArmSpec,
    CameraCapabilities,
    CameraHealth,
    CameraInfo,
    CameraSettings,
    ClockSample,
    Frame,
    TimestampKind,
    TriggerKind,
)
from rig.acquisition.cameras.inbox import Inbox
from rig.acquisition.cameras.link import LinkDown, LinkSilent, WorkerLink
from rig.acquisition.cameras.workers import wire

logger = logging.getLogger(__name__)

PING_S = 1.0
PREVIEW_S = 3.0
"""What showing what it sees may take beyond a command: a body's mirror, a long exposure."""


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
    """One camera in a worker process of its own; a :class:`CameraDevice`.

    When the worker does not answer in time it is ended and the camera counts as gone. The next
    :meth:`configure` or :meth:`arm` starts another one and restores the settings.
    """

    def __init__(self, spec: WorkerSpec, camera_id: str) -> None:
        self._spec = spec
        self._id = camera_id
        self._link: WorkerLink | None = None
        self._commands = threading.RLock()
        self._inbox = Inbox(camera_id)
        self._armed = False
        self._problem = ""
        """Why the worker is of no use any more; it is replaced at the next command."""
        self._silence = ""
        """What the last look at its health waited for in vain; a later look may be luckier."""
        self._note = ""
        """What is wrong with a camera that still answers."""
        self._closed = False
        self._settings = CameraSettings()
        self._library_counts: Mapping[str, int] = {}
        self._shown: Frame | None = None
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
        self._problem = self._problem or why
        self._inbox.wake()
        if link is not None:
            logger.warning("camera %s lost: %s", self._id, why)
            self._inbox.counts["lost"] += 1
            link.kill()

    def _on_end(self, reason: str) -> None:
        if self._link is not None and not self._closed:
            self._problem = self._problem or reason
        self._inbox.wake()

    def _on_message(self, header: wire.Header, payload: bytes) -> None:
        if "frame" in header:
            self._inbox.put(header["frame"], payload)
            return
        if "preview" in header:
            self._shown = self._inbox.read(header["preview"], payload)
            return
        told = header.get("failed", {})
        if told.get("detail") in ("camera-gone", "camera-error"):
            self._problem = self._problem or told["problem"]
        else:
            self._note = told.get("problem", "")
        self._inbox.wake()

    def _ask(
        self,
        do: str,
        args: Mapping[str, object] | None = None,
        over: Callable[[], bool] | None = None,
    ) -> Any:  # noqa: ANN401
        link = self._link
        if self._closed or link is None:
            raise self._gone("it was closed" if self._closed else self._problem)
        try:
            more_s = 0.0 if over is None else PREVIEW_S
            return link.ask(do, args or {}, self._spec.command_deadline_s + more_s, over)
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
        self._inbox.counts["restarts"] += 1
        if self._settings != CameraSettings():
            self._configure(self._settings)

    def configure(self, settings: CameraSettings) -> CameraSettings:
        """Ask for settings; what the camera has now."""
        with self._commands:
            self._revive()
            return self._configure(settings)

    def _configure(self, settings: CameraSettings) -> CameraSettings:
        self._armed = False
        real = CameraSettings(**self._ask("configure", {"settings": asdict(settings)}))
        if real.pixel_format and not pixels.understood(real.pixel_format):
            raise InputError(
                "camera-setting",
                f"pixel_format: {real.pixel_format} of camera {self._id} cannot be read",
                "choose a Mono, Bayer or RGB format of up to 16 bits",
            )
        wanted = {name: value for name, value in asdict(settings).items() if value is not None}
        self._settings = CameraSettings(**{**asdict(self._settings), **wanted})
        return real

    def arm(self, spec: ArmSpec) -> None:
        """Get ready; frames that came before are dropped and counted."""
        with self._commands:
            self._revive()
            self._armed, self._note = False, ""
            number = self._inbox.begin(spec)
            dropped = self._ask("arm", {"number": number, "shots": spec.shots})
            self._inbox.counts["stale_frames"] += int(dropped)
            self._armed = True

    def preview(self, over: Callable[[], bool]) -> Frame | None:
        """What it sees now, while it is not armed."""
        with self._commands:
            if self._armed or over():
                return None
            self._revive()
            self._shown = None
            return self._shown if self._ask("preview", over=over) else None

    def software_trigger(self) -> None:
        """Expose now."""
        if self._capabilities.trigger is not TriggerKind.SOFTWARE:
            raise InputError(
                "camera-trigger",
                f"camera {self._id} is not triggered by software",
                "set the option 'trigger' of its backend to 'software'",
            )
        with self._commands:
            if not self._armed:
                raise DeviceError(
                    "camera-not-ready", f"camera {self._id} is not armed", "arm it first"
                )
            self._inbox.fired()
            self._ask("trigger")

    def wait_frames(self, count: int, timeout_s: float) -> Sequence[Frame]:
        """The frames since :meth:`arm`, fewer than ``count`` when time is up or it is gone."""
        link = self._link
        if link is not None:
            link.tell("collect")
        return self._inbox.wait(
            count, timeout_s, lambda: bool(self._closed or self._problem or self._note)
        )

    def disarm(self) -> None:
        """Stop waiting for triggers; nothing to do for a camera that is gone."""
        with self._commands:
            if self._armed:
                self._armed = False
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
        gone = "it was closed" if self._closed else self._problem or self._silence
        return CameraHealth(
            connected=not gone,
            armed=self._armed and not gone,
            problem=gone or self._note,
            counters={**self._library_counts, **self._inbox.counts},
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
            self._closed, self._armed = True, False
            link, self._link = self._link, None
        self._inbox.wake()
        if link is not None:
            link.close()


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
