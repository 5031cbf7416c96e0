"""The engine of today: one process per task on this machine."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from common.errors import CancelledError, InternalError, RigwrightError, TooLargeError
from common.progress import CancelToken, Progress, ProgressCallback
from common.threads import ONE_BLAS_THREAD
from service.ipc import message_from_line, task_line
from service.jobs.engine import Task
from service.kinds.base import RequestT, ResultT
from service.logs import log

TASKS_PROGRAM = "service.tasks"
_POLL_S = 0.05


class ProcessEngine:
    """Runs each task in a new interpreter, in a process group of its own.

    The numerical libraries' threads are set to one in the environment, before the process
    starts: they read it when they are loaded, and several tasks with a thread per core each
    would slow one another down many times over. ``cancel_grace_s``: how long a task may take to
    stop by itself before it and everything it started is killed. ``step_back``: how much less
    tasks count than this process where all cores are busy (niceness). ``program``: the module
    that does tasks when it is run.
    """

    def __init__(
        self, cancel_grace_s: float = 0.8, step_back: int = 0, program: str = TASKS_PROGRAM
    ) -> None:
        self._cancel_grace_s = cancel_grace_s
        self._step_back = step_back
        self._program = program

    def run(
        self, task: Task[RequestT, ResultT], report: ProgressCallback, cancel: CancelToken
    ) -> ResultT:
        """See :class:`service.jobs.engine.Engine`."""
        if cancel.is_set():
            raise CancelledError
        with (task.folder.parent / f"{task.folder.name}.log").open("w+b") as log_file:
            with _process(self._program, task, log_file) as process:
                _steps_back(process, self._step_back)
                outcome = self._listen(process, task, report, cancel)
            _log_output(log_file)
        Path(log_file.name).unlink(missing_ok=True)
        if isinstance(outcome, RigwrightError):
            raise outcome
        return outcome

    def _listen(
        self,
        process: subprocess.Popen[bytes],
        task: Task[RequestT, ResultT],
        report: ProgressCallback,
        cancel: CancelToken,
    ) -> ResultT | RigwrightError:
        limit_s = task.kind.time_limit_s
        too_late_s = None if limit_s is None else time.monotonic() + limit_s
        kill_at_s = None
        for line in _lines(process):
            now_s = time.monotonic()
            message = None if line is None else message_from_line(line, task.kind)
            if isinstance(message, Progress):
                report(message)
            elif message is not None:
                return message
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
def _process(
    program: str, task: Task[RequestT, ResultT], log_file: IO[bytes]
) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(  # noqa: S603 - this interpreter, and a module of ours
        [sys.executable, "-m", program],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=log_file,
        env=os.environ | ONE_BLAS_THREAD,
        # Not a session of its own: where Linux shares cores out among sessions first, a task's
        # niceness would weigh nothing against the service's.
        process_group=0,
    )
    try:
        with suppress(BrokenPipeError):
            _standard_input(process).write(task_line(task))
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


def _steps_back(process: subprocess.Popen[bytes], by: int) -> None:
    """Lower a process's priority, and so that of all it will start."""
    if by:
        now = os.getpriority(os.PRIO_PROCESS, 0)
        with suppress(ProcessLookupError):
            os.setpriority(os.PRIO_PROCESS, process.pid, min(now + by, 19))


def _standard_input(process: subprocess.Popen[bytes]) -> IO[bytes]:
    if process.stdin is None:
        raise InternalError("no-pipe", "a task has no standard input", "report this fault")
    return process.stdin


def _ask_to_stop(process: subprocess.Popen[bytes]) -> None:
    with suppress(BrokenPipeError):
        _standard_input(process).write(b"stop\n")
        _standard_input(process).flush()


def _lines(process: subprocess.Popen[bytes]) -> Iterator[bytes | None]:
    """Lines as they come, and None at least every :data:`_POLL_S`; ends with the process."""
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
        yield from lines


def _log_output(log_file: IO[bytes]) -> None:
    size = log_file.seek(0, os.SEEK_END)
    log_file.seek(max(0, size - 4096))
    text = log_file.read().decode(errors="replace").strip()
    if text:
        log.warning("a task wrote to its standard error", extra={"fields": {"output": text}})
