"""The engine of today: one process per task on this machine."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from common.errors import CancelledError, InternalError, RigwrightError, TooLargeError
from common.progress import CancelToken
from service.jobs.engine import Report, Task
from service.logs import log
from service.wire import error_from_fields, line

_POLL_S = 0.05
_ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
    "NUMEXPR_NUM_THREADS": "1",
}


class ProcessEngine:
    """Runs each task in a new interpreter, in a process group of its own.

    The numerical libraries' threads are set to one in the environment, before the process
    starts: they read it when they are loaded, and several tasks with a thread per core each
    would slow one another down many times over. ``cancel_grace_s``: how long a task may take to
    stop by itself before it and everything it started is killed.
    """

    def __init__(self, cancel_grace_s: float = 0.8) -> None:
        self._cancel_grace_s = cancel_grace_s

    def run(self, task: Task, report: Report, cancel: CancelToken) -> dict[str, Any]:
        """See :class:`service.jobs.engine.Engine`."""
        if cancel.is_set():
            raise CancelledError
        with (task.folder.parent / f"{task.folder.name}.log").open("w+b") as log_file:
            with _process(task, log_file) as process:
                outcome = self._listen(process, task, report, cancel)
            _log_output(log_file)
        Path(log_file.name).unlink(missing_ok=True)
        if isinstance(outcome, RigwrightError):
            raise outcome
        return outcome

    def _listen(
        self, process: subprocess.Popen[bytes], task: Task, report: Report, cancel: CancelToken
    ) -> dict[str, Any] | RigwrightError:
        limit_s = task.kind.time_limit_s
        too_late_s = None if limit_s is None else time.monotonic() + limit_s
        kill_at_s = None
        for message in _messages(process):
            now_s = time.monotonic()
            if message is not None and "progress" in message:
                report(message["progress"])
            elif message is not None and "error" in message:
                return error_from_fields(message["error"])
            elif message is not None:
                result: dict[str, Any] = message["result"]
                return result
            if kill_at_s is None and cancel.is_set():
                _ask_to_stop(process)
                kill_at_s = now_s + self._cancel_grace_s
            if kill_at_s is not None and now_s >= kill_at_s:
                return CancelledError()
            if too_late_s is not None and now_s >= too_late_s:
                return TooLargeError(
                    "time",
                    f"the work takes longer than the {limit_s:g} s it is allowed",
                    "give a smaller scan, or raise the limit in the settings",
                )
        if kill_at_s is not None:
            return CancelledError()
        return InternalError(
            "worker-died",
            "the process that did the work died",
            "see the log, then try again",
        )


@contextmanager
def _process(task: Task, log_file: IO[bytes]) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "service.jobs.child"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=log_file,
        env=os.environ | _ONE_THREAD,
        start_new_session=True,
    )
    try:
        with suppress(BrokenPipeError):
            _standard_input(process).write(_as_message(task))
            _standard_input(process).flush()
        yield process
    finally:
        # The task's own worker processes must not outlive it. Killing the group before its
        # leader is waited for makes sure that the number still means this group.
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(BrokenPipeError):
                    pipe.close()


def _as_message(task: Task) -> bytes:
    return line(
        {
            "entry": task.kind.entry,
            "request": dict(task.request),
            "inputs": {role: str(path) for role, path in task.inputs.items()},
            "folder": str(task.folder),
            "memory_limit_bytes": task.kind.memory_limit_bytes,
        }
    )


def _standard_input(process: subprocess.Popen[bytes]) -> IO[bytes]:
    if process.stdin is None:
        raise InternalError("no-pipe", "a task has no standard input", "report this fault")
    return process.stdin


def _ask_to_stop(process: subprocess.Popen[bytes]) -> None:
    with suppress(BrokenPipeError):
        _standard_input(process).write(b"stop\n")
        _standard_input(process).flush()


def _messages(process: subprocess.Popen[bytes]) -> Iterator[dict[str, Any] | None]:
    """Messages as they come, and None at least every :data:`_POLL_S`; ends with the process."""
    if process.stdout is None:
        raise InternalError("no-pipe", "a task has no standard output", "report this fault")
    pending, handle = b"", process.stdout.fileno()
    poll = select.poll()
    poll.register(handle, select.POLLIN)
    while True:
        if not poll.poll(_POLL_S * 1000.0):
            yield None
            continue
        chunk = os.read(handle, 1 << 16)
        if not chunk:
            return
        *lines, pending = (pending + chunk).split(b"\n")
        yield from (json.loads(text) for text in lines)


def _log_output(log_file: IO[bytes]) -> None:
    size = log_file.seek(0, os.SEEK_END)
    log_file.seek(max(0, size - 4096))
    text = log_file.read().decode(errors="replace").strip()
    if text:
        log.warning("a task wrote to its standard error", extra={"fields": {"output": text}})
