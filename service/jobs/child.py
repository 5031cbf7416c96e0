"""The process of one task, such as ``python -m service.tasks``.

It reads the task from its standard input, which stays open: a further line asks it to stop, and
the end of the input means that the service is gone, so that nothing is left running without
anybody to answer to. Messages go out on what was its standard output.
"""

from __future__ import annotations

import errno
import os
import resource
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import Any, BinaryIO

from common.errors import CancelledError, InternalError, RigwrightError, TooLargeError
from common.progress import Progress, Rising
from service.ipc import TaskMessage, outcome_line, progress_line
from service.jobs.engine import Running, Work
from service.kinds.base import Result

FindWork = Callable[[str], Work[Any, Any]]
"""The work of a kind of job by its name: imports what it needs only then."""

_PROGRESS_INTERVAL_S = 0.2
_LOADING = Progress("loading the program", 0.0)
"""Told before the imports of a kind of work, which take seconds."""


class _Reporter:
    """Sends progress on, at most a few times a second but never missing a new stage or start."""

    def __init__(self, out: BinaryIO) -> None:
        self._out = out
        self._seen: set[tuple[str, int]] = set()
        self._sent_s = 0.0

    def __call__(self, progress: Progress, /) -> None:
        # Starts run side by side and report in turn: only the first word of each is news.
        where, now_s = (progress.stage, progress.start), time.monotonic()
        if where in self._seen and now_s - self._sent_s < _PROGRESS_INTERVAL_S:
            return
        self._seen.add(where)
        self._sent_s = now_s
        self._out.write(progress_line(progress))


def main(find: FindWork) -> int:
    """Do the one task and say how it ended."""
    out = _take_standard_output()
    message = TaskMessage(sys.stdin.buffer.readline())
    cancel = threading.Event()
    threading.Thread(target=_obey, args=(cancel,), daemon=True).start()
    limit = message.memory_limit_bytes
    if limit is not None:
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    out.write(outcome_line(_outcome(find, message, Running(Rising(_Reporter(out)), cancel))))
    return 0


def _take_standard_output() -> BinaryIO:
    # Libraries print banners. They would garble the messages, so what they think is standard
    # output becomes standard error.
    out = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)
    return out


def _obey(cancel: threading.Event) -> None:
    for _ in sys.stdin.buffer:
        cancel.set()
    os.killpg(os.getpgrp(), signal.SIGKILL)


def _outcome(find: FindWork, message: TaskMessage, running: Running) -> Result | RigwrightError:
    try:
        running.report(_LOADING)
        work = find(message.kind_name)
        if running.cancel.is_set():
            raise CancelledError
        result: Result = work.function(message.task(work.kind), running)
        return result
    except RigwrightError as error:
        return error
    except MemoryError:
        return TooLargeError(
            "memory",
            "the work needs more memory than is allowed",
            "give smaller or fewer files, or raise the limit in the settings",
        )
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            return _crashed()
        return InternalError("disk-full", "the disk is full", "make room, then try again")
    except Exception:  # noqa: BLE001 - whatever it is, the service must hear that the task failed
        return _crashed()


def _crashed() -> InternalError:
    """The fault, told to the log in full and to the client in short."""
    traceback.print_exc()
    return InternalError("job-crashed", "the work stopped on a fault", "see the log")
