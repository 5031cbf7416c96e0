"""The loop of a worker: commands in on standard input, answers and frames out.

Three threads. The main one runs commands. One reads standard input: when that ends the host is
gone, and the worker ends too, even if the library hangs. One fetches frames while armed. Commands
that change the camera have it to themselves; a software trigger does not wait for the fetching.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import queue
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, BinaryIO, Optional, Protocol, runtime_checkable

from common.errors import DeviceError, InternalError, RigwrightError
from rig.acquisition.cameras.workers import wire

POLL_S = 0.05
"""How long one look for frames may take: what arming waits for it at most."""
LAST_GRACE_S = 3.0
"""Time to let go of the camera after the host went; a library that hangs is left behind."""

REST_S = 4.0
"""A camera that has shown what it sees, and is asked for nothing for so long, goes back to rest."""

BESIDE = ("ping", "collect")
"""Commands that never wait for the fetching."""

Picture = tuple[wire.Header, bytes]
"""Description of a frame and its bytes."""


class Driver(Protocol):
    """One camera as its library shows it. Plain values only: they cross to the host as JSON."""

    shares_library: bool
    """Whether :meth:`trigger` and :meth:`clock` may run while frames are fetched."""

    def open(self, camera_id: str) -> Mapping[str, Any]:
        """Take hold of a camera: ``info`` and ``capabilities``."""
        ...

    def configure(self, settings: Mapping[str, Any]) -> Mapping[str, Any]:
        """Set what is not None; all settings as they are now."""
        ...

    def arm(self, shots: int) -> int:
        """Be ready for triggers; returns how many old frames were dropped."""
        ...

    def trigger(self) -> None:
        """Expose now."""
        ...

    def collect(self) -> None:
        """The trigger has gone: frames may be fetched. Runs beside :meth:`poll`."""
        ...

    def poll(self, timeout_s: float) -> Sequence[Picture]:
        """Frames that have come, waiting at most so long for the first."""
        ...

    def disarm(self) -> None:
        """Take no more triggers."""
        ...

    def clock(self, count: int) -> Sequence[Sequence[int]]:
        """Readings of the camera's clock: host before, device, host after, all in ns."""
        ...

    def ping(self) -> Mapping[str, int]:
        """Ask the camera for a sign of life; counters of the library. Runs beside :meth:`poll`.

        Must not wait for a download: whoever asks takes a late answer for a camera that is gone.
        """
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


@runtime_checkable
class PreviewDriver(Driver, Protocol):
    """A driver whose camera can show what it sees."""

    def preview(self, over: Callable[[], bool]) -> Optional[Picture]:  # noqa: UP045
        """What it sees now, while it is not armed; None when given up because ``over`` is true."""
        ...

    def rest(self) -> None:
        """Whoever looked has gone, or arming is next: as if nobody had looked."""
        ...


class Worker:
    """Serves one driver to the host at the other end of two streams."""

    def __init__(
        self,
        make: Callable[[Mapping[str, Any]], Driver],
        out: BinaryIO,
        on_host_gone: Callable[[], None],
    ) -> None:
        self._make = make
        self._out = out
        self._on_host_gone = on_host_gone
        self._driver: Driver | None = None
        self._commands: queue.Queue[wire.Header | None] = queue.Queue()
        self._writing = threading.Lock()
        self._camera = threading.Lock()
        self._fetching = threading.Event()
        self._arm_number = 0
        self._armed = False
        self._shows = False
        self._over = False

    def run(self, source: BinaryIO) -> None:
        """Serve until the host says ``close`` or is gone."""
        threading.Thread(target=self._listen, args=(source,), daemon=True).start()
        threading.Thread(target=self._fetch, daemon=True).start()
        while (command := self._next()) is not None:
            self._answer(command)
            if command.get("do") == "close":
                break
        else:
            self._let_go()
        with self._writing:
            # A picture may be on its way still, and who listened has hung up.
            self._over = True

    def _next(self) -> Optional[wire.Header]:  # noqa: UP045
        while True:
            try:
                return self._commands.get(timeout=REST_S if self._shows else None)
            except queue.Empty:
                self._rest()

    def _rest(self) -> None:
        driver, shows = self._driver, self._shows
        self._shows = False
        if shows and isinstance(driver, PreviewDriver):
            # What it says of a body that does not go back to rest, the next command hears too.
            with contextlib.suppress(RigwrightError):
                driver.rest()

    def _listen(self, source: BinaryIO) -> None:
        with contextlib.suppress(wire.WireError, OSError):
            while (message := wire.receive(source)) is not None:
                self._commands.put(message[0])
        self._commands.put(None)
        self._on_host_gone()

    def _say(self, header: Mapping[str, object], payload: bytes = b"") -> None:
        with self._writing, contextlib.suppress(OSError):
            if not self._over:
                wire.send(self._out, header, payload)

    def _answer(self, command: wire.Header) -> None:
        number = command.get("n")
        try:
            self._say({"re": number, "ok": self._do(command)})
        except RigwrightError as error:
            self._say({"re": number, "error": spell(error)})
        except Exception as error:  # noqa: BLE001  whatever a library throws is an answer, not the end
            self._say({"re": number, "error": spell(library_error(error))})

    def _do(self, command: wire.Header) -> object:
        do = command.get("do")
        args = command.get("args", {})
        if do == "discover":
            return self._discover(args)
        if do == "open":
            return self._open(args)
        if do == "close":
            self._let_go()
            return None
        if self._driver is None:
            raise InternalError("worker", f"'{do}' before 'open'", "report this")
        return self._drive(self._driver, str(do), args)

    def _discover(self, args: Mapping[str, Any]) -> object:
        driver: Any = self._make(args["options"])
        return driver.discover(args["skip"])

    def _open(self, args: Mapping[str, Any]) -> object:
        self._driver = self._make(args["options"])
        return self._driver.open(str(args["id"]))

    def _drive(self, driver: Driver, do: str, args: Mapping[str, Any]) -> object:
        beside = ("ping", "collect", "trigger", "clock") if driver.shares_library else BESIDE
        if do == "enough":
            return None  # that it came has ended a preview
        if do in beside:
            return self._step(driver, do, args)
        with self._alone():
            return self._step(driver, do, args)

    def _step(self, driver: Driver, do: str, args: Mapping[str, Any]) -> object:
        if do in ("arm", "disarm", "configure"):
            return self._change(driver, do, args)
        if do == "preview":
            return self._preview(driver)
        if do == "clock":
            return driver.clock(int(args["count"]))
        if do not in ("trigger", "collect", "ping"):
            raise InternalError("worker", f"unknown command '{do}'", "report this")
        return getattr(driver, do)()

    def _preview(self, driver: Driver) -> bool:
        """Send what the camera sees; whether there was time for it."""
        if self._armed or not isinstance(driver, PreviewDriver):
            raise InternalError("worker", "'preview' of a camera that is armed", "report this")
        self._shows = True
        picture = driver.preview(lambda: not self._commands.empty())
        if picture is not None:
            self._say({"preview": picture[0]}, picture[1])
        return picture is not None

    def _change(self, driver: Driver, do: str, args: Mapping[str, Any]) -> object:
        # Not armed while it changes: what fails half-way must not be fetched from.
        was_armed, self._armed = self._armed, False
        self._rest()
        if do == "arm":
            dropped = driver.arm(int(args["shots"]))
            self._arm_number, self._armed = int(args["number"]), True
            return dropped
        if was_armed:
            driver.disarm()
        return driver.configure(args["settings"]) if do == "configure" else None

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        # Locks of Python are not fair: without the event the fetching thread, which asks again
        # at once, could keep a command waiting for seconds.
        self._fetching.clear()
        try:
            with self._camera:
                yield
        finally:
            if self._armed:
                self._fetching.set()

    def _fetch(self) -> None:
        while True:
            self._fetching.wait()
            with self._camera:
                driver, number = self._driver, self._arm_number
                if driver is None or not self._armed:
                    self._fetching.clear()
                    continue
                pictures = self._poll(driver)
            for header, payload in pictures:
                self._say({"frame": {**header, "arm": number}}, payload)

    def _poll(self, driver: Driver) -> Sequence[Picture]:
        try:
            return driver.poll(POLL_S)
        except Exception as error:  # noqa: BLE001  the thread that fetches must not die unheard
            self._armed = False
            self._fetching.clear()
            told = error if isinstance(error, RigwrightError) else library_error(error)
            self._say({"failed": spell(told)})
            return ()

    def _let_go(self) -> None:
        with self._alone():
            self._armed = False
            if self._driver is not None:
                self._driver.close()
            self._driver = None


def library_error(error: Exception) -> DeviceError:
    """What a library threw that its driver did not foresee, as an error that can be told."""
    return DeviceError(
        "camera-error",
        f"the camera's library failed: {type(error).__name__}: {error}",
        "check the camera's power and cable, then try again",
    )


def spell(error: RigwrightError) -> dict[str, str]:
    """An error as it crosses to the host."""
    return {
        "kind": error.kind,
        "detail": error.detail,
        "problem": error.problem,
        "remedy": error.remedy,
    }


def _end_soon() -> None:
    # A library may hang in the main thread for good; the host is gone, so nobody else ends it.
    timer = threading.Timer(LAST_GRACE_S, os._exit, (1,))
    timer.daemon = True
    timer.start()


def main(target: str) -> None:
    """Serve the driver ``package.module:Class`` on standard input and output."""
    # Libraries print to standard output; a word of theirs between two messages would break both.
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    module, _, name = target.partition(":")
    make = getattr(importlib.import_module(module), name)
    Worker(make, out, _end_soon).run(sys.stdin.buffer)
    out.close()
    sys.stderr.flush()
    # Nothing is left to be done, and some libraries crash or hang while they are unloaded.
    os._exit(0)
