"""The host's end of a worker: commands with deadlines, and no process left behind."""

from __future__ import annotations

import contextlib
import os
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from concurrent.futures import TimeoutError as FutureTimeoutError
from pathlib import Path
from typing import Any, BinaryIO, cast

import rig
from common.errors import DeviceError, InputError, InternalError, RigwrightError
from rig.acquisition.cameras.workers import wire

_BOOT = (
    "import sys; sys.path.append(sys.argv[1]); "
    "from rig.acquisition.cameras.workers.serve import main; main(sys.argv[2])"
)
_KINDS: Mapping[str, type[RigwrightError]] = {
    kind.kind: kind for kind in (DeviceError, InputError, InternalError)
}
_GRACE_S = 2.0
LOOK_S = 0.01
"""How often whoever waits for a preview looks whether it is still wanted."""

OnMessage = Callable[[wire.Header, bytes], None]


class LinkDown(Exception):  # noqa: N818  a state of the link, which its user turns into an error
    """The worker is gone or did not answer in time."""


class LinkSilent(LinkDown):
    """The worker did not answer in time; it may yet."""


class WorkerLink:
    """One worker process. Any thread may ask; answers are told apart by number."""

    def __init__(
        self,
        interpreter: str,
        driver: str,
        environment: Mapping[str, str],
        on_message: OnMessage,
        on_end: Callable[[str], None],
    ) -> None:
        root = str(Path(rig.__file__).resolve().parents[1])
        # -I: nothing of the folder the service was started in may shadow a library.
        # A session of its own: Ctrl-C is for the host, which then disarms and closes in order.
        self._process = subprocess.Popen(  # noqa: S603
            [interpreter, "-I", "-c", _BOOT, root, driver],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, **environment},
            start_new_session=True,
        )
        self._on_message, self._on_end = on_message, on_end
        self._answers: dict[int, Future[Any]] = {}
        self._lock = threading.Lock()
        self._writing = threading.Lock()
        self._next = 0
        self._down = ""
        self._words: deque[str] = deque(maxlen=5)
        self._threads = [
            threading.Thread(target=self._read, name="camera-link", daemon=True),
            threading.Thread(target=self._overhear, name="camera-words", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def pid(self) -> int:
        """The worker's process id."""
        return self._process.pid

    def ask(
        self,
        do: str,
        args: Mapping[str, object],
        deadline_s: float,
        over: Callable[[], bool] | None = None,
    ) -> Any:  # noqa: ANN401
        """The answer to one command. Once ``over`` is true the worker is told to give up.

        Raises :class:`LinkSilent` when none comes in time, :class:`LinkDown` when none will
        come, and the worker's own error when it answers with one.
        """
        answer: Future[Any] = Future()
        with self._lock:
            if self._down:
                raise LinkDown(self._down)
            self._next += 1
            number = self._next
            self._answers[number] = answer
        try:
            self._write({"n": number, "do": do, "args": args})
            return answer.result(
                deadline_s if over is None else self._watch(answer, over, deadline_s)
            )
        except FutureTimeoutError:
            raise LinkSilent(f"no answer to '{do}' within {deadline_s:g} s") from None
        finally:
            with self._lock:
                self._answers.pop(number, None)

    def _watch(self, answer: Future[Any], over: Callable[[], bool], deadline_s: float) -> float:
        """Wait until there is an answer or it is ``over``; how long there is still time, in s."""
        until = time.monotonic() + deadline_s
        while time.monotonic() < until and not wait([answer], LOOK_S).done:
            if over():
                self.tell("enough")
                break
        return max(0.0, until - time.monotonic())

    def tell(self, do: str) -> None:
        """Send a command whose answer nobody needs; never raises."""
        with contextlib.suppress(LinkDown):
            self._write({"n": 0, "do": do})

    def _write(self, header: Mapping[str, object]) -> None:
        try:
            with self._writing:
                wire.send(cast("BinaryIO", self._process.stdin), header)
        except (OSError, ValueError) as error:
            raise LinkDown(f"its process does not listen: {error}") from None

    def _read(self) -> None:
        source = cast("BinaryIO", self._process.stdout)
        reason = "its process ended"
        try:
            while (message := wire.receive(source)) is not None:
                self._take(*message)
        except (wire.WireError, OSError, ValueError) as error:
            reason = f"its process sent nonsense: {error}"
        self._threads[1].join(_GRACE_S)
        words = self._words[-1] if self._words else ""
        self._end(f"{reason}: {words}" if words else reason)

    def _take(self, header: wire.Header, payload: bytes) -> None:
        if "re" not in header:
            self._on_message(header, payload)
            return
        with self._lock:
            answer = self._answers.pop(header["re"], None)
        if answer is None:
            return
        if "error" in header:
            answer.set_exception(read_error(header["error"]))
        else:
            answer.set_result(header.get("ok"))

    def _overhear(self) -> None:
        source = cast("BinaryIO", self._process.stderr)
        with contextlib.suppress(OSError, ValueError):
            for line in source:
                self._words.append(line.decode(errors="replace").strip()[:300])

    def _end(self, reason: str) -> None:
        with self._lock:
            self._down = reason
            waiting, self._answers = list(self._answers.values()), {}
        for answer in waiting:
            answer.set_exception(LinkDown(reason))
        self._on_end(reason)

    def close(self) -> None:
        """Let the worker let go of its camera, for at most two seconds; then end it."""
        with contextlib.suppress(LinkDown, RigwrightError, subprocess.TimeoutExpired):
            self.ask("close", {}, _GRACE_S)
            self._process.wait(_GRACE_S)
        self.kill()

    def kill(self) -> None:
        """End the worker now, whatever it is doing."""
        self._process.kill()
        self._process.wait()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(_GRACE_S)
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()


def read_error(spelt: Mapping[str, str]) -> RigwrightError:
    """A worker's error as it was raised there."""
    kind = _KINDS.get(spelt.get("kind", ""), InternalError)
    return kind(spelt.get("detail", "worker"), spelt.get("problem", ""), spelt.get("remedy", ""))
