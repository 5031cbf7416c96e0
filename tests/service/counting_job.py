"""Small real jobs for tests: they run in processes like any other, but need no solver."""

from __future__ import annotations

import ctypes
import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from common.errors import CancelledError, InputError
from common.progress import CancelToken, Progress
from service.jobs.engine import JobKind

COUNT = JobKind("count", "counting_job:count")
KINDS = {
    kind.name: kind
    for kind in (
        COUNT,
        JobKind("count-briefly", "counting_job:count", time_limit_s=0.5),
        JobKind("misbehave", "counting_job:misbehave", memory_limit_bytes=2 << 30),
    )
}
Report = Callable[[Progress], None]


def count(
    request: Mapping[str, Any],
    inputs: Mapping[str, Path],
    folder: Path,
    report: Report,
    cancel: CancelToken,
) -> dict[str, Any]:
    """Counts to ``to``, a step each ``step_s``; writes what it counted."""
    to, step_s = int(request["to"]), float(request.get("step_s", 0.01))
    if to < 0:
        raise InputError("value", f"cannot count to {to}", "give zero or more")
    for n in range(to):
        if cancel.is_set() and not request.get("deaf"):
            raise CancelledError
        report(Progress("counting", n / to, start=n, iteration=n, cost=float("nan")))
        time.sleep(step_s)
    (folder / "numbers.txt").write_text("\n".join(map(str, range(to))))
    read = {role: path.suffix + ":" + str(path.stat().st_size) for role, path in inputs.items()}
    return {"counted": to, "read": read}


def misbehave(
    request: Mapping[str, Any],
    inputs: Mapping[str, Path],
    folder: Path,
    report: Report,
    cancel: CancelToken,
) -> dict[str, Any]:
    """Fails in the way it is asked to."""
    del inputs, folder, report, cancel
    how = request["how"]
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
        return {"eaten": len(bytearray(8 << 30))}
    if how == "print":
        print("a banner", flush=True)  # noqa: T201 - as some libraries do
        subprocess.run(["echo", "another"], check=True)
    if how == "spawn":
        subprocess.Popen(
            [sys.executable, "-c", f"import time; time.sleep(600) # {request['mark']}"]
        )
    if how == "threads":
        import numpy  # noqa: F401
        from threadpoolctl import threadpool_info

        return {"threads": [pool["num_threads"] for pool in threadpool_info()]}
    return {"how": how}
