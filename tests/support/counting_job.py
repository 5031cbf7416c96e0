"""Small real jobs for tests: they run in processes like any other, but need no solver.

``python -m counting_job`` is the program of their processes.
"""

from __future__ import annotations

import ctypes
import errno
import os
import signal
import subprocess
import sys
import time

from common.errors import CancelledError, InputError
from common.progress import Progress
from service.jobs.child import main
from service.jobs.engine import Running, Task, Work
from service.kinds.base import JobKind, Request, Result
from service.tasks.registry import work_of


class CountRequest(Request):
    to: int
    step_s: float = 0.01
    deaf: bool = False


class Counted(Result):
    counted: int
    read: dict[str, str]


class MisbehaveRequest(Request):
    how: str
    mark: str = ""


class Misbehaved(Result):
    how: str = ""
    eaten: int = 0
    threads: tuple[int, ...] = ()
    rank: tuple[int, int] | None = None


COUNT = JobKind("count", CountRequest, Counted)
BRIEFLY = JobKind("count-briefly", CountRequest, Counted, time_limit_s=0.5)
MISBEHAVE = JobKind("misbehave", MisbehaveRequest, Misbehaved, memory_limit_bytes=2 << 30)
KINDS = {"count": COUNT, "count-briefly": BRIEFLY, "misbehave": MISBEHAVE}


def count(task: Task[CountRequest, Counted], running: Running) -> Counted:
    """Counts to ``to``, a step each ``step_s``; writes what it counted."""
    to = task.request.to
    if to < 0:
        raise InputError("value", f"cannot count to {to}", "give zero or more")
    for n in range(to):
        if running.cancel.is_set() and not task.request.deaf:
            raise CancelledError
        running.report(Progress("counting", n / to, start=n, iteration=n, cost=float("nan")))
        time.sleep(task.request.step_s)
    (task.folder / "numbers.txt").write_text("\n".join(map(str, range(to))))
    read = {r: path.suffix + ":" + str(path.stat().st_size) for r, path in task.inputs.items()}
    return Counted(counted=to, read=read)


def misbehave(task: Task[MisbehaveRequest, Misbehaved], running: Running) -> Misbehaved:
    """Fails in the way it is asked to."""
    del running
    how = task.request.how
    if how == "refuse":
        raise InputError("value", "seven is not a number of cameras", "give another")
    if how == "raise":
        raise ZeroDivisionError("as asked")
    if how == "fill":
        raise OSError(errno.ENOSPC, "No space left on device")
    if how == "segfault":
        ctypes.string_at(0)
    if how == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if how == "eat":
        return Misbehaved(eaten=len(bytearray(8 << 30)))
    if how == "print":
        print("a banner", flush=True)  # noqa: T201 - as some libraries do
        subprocess.run(["echo", "another"], check=True)
    if how == "spawn":
        subprocess.Popen(
            [sys.executable, "-c", f"import time; time.sleep(600) # {task.request.mark}"]
        )
    if how == "rank":
        return Misbehaved(rank=(os.nice(0), os.getsid(0)))
    if how == "threads":
        import numpy  # noqa: F401
        from threadpoolctl import threadpool_info

        return Misbehaved(threads=tuple(pool["num_threads"] for pool in threadpool_info()))
    return Misbehaved(how=how)


def find(kind: str) -> Work:
    if kind == "misbehave":
        return Work(MISBEHAVE, misbehave)
    return Work(KINDS[kind], count) if kind in KINDS else work_of(kind)


if __name__ == "__main__":
    sys.exit(main(find))
