"""How a command runs its work, shows its errors and keeps half-written folders away."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import typer
from pydantic import ValidationError

from common.errors import InputError, InternalError, RigwrightError
from service.cli.progress import show_progress
from service.jobs.engine import Engine, Task
from service.jobs.process import ProcessEngine
from service.kinds.base import JobKind, RequestT, ResultT, RunContext
from service.logs import log
from service.problems import exit_code_of


@contextmanager
def one_line_errors() -> Iterator[None]:
    """Show an error as one line on standard error and end with its exit code."""
    kept = _KeepRecords()
    log.addHandler(kept)
    log.propagate = False
    try:
        yield
    except ValidationError as error:
        # What an option's own limits let through, the request's do not.
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        message = first["msg"].removeprefix("Value error, ").replace("Input should", "it should")
        problem = f"{where}: {message}" if where else message
        refused = InputError("request-invalid", problem, "see --help")
        sys.stderr.write(f"rigwright: {refused}\n")
        raise typer.Exit(exit_code_of(refused)) from None
    except RigwrightError as error:
        if isinstance(error, InternalError) and kept.lines:
            # A fault of ours: whoever reports it needs more than one line.
            sys.stderr.write("\n".join(kept.lines) + "\n")
        sys.stderr.write(f"rigwright: {error}\n")
        raise typer.Exit(exit_code_of(error)) from None
    finally:
        log.removeHandler(kept)


class _KeepRecords(logging.Handler):
    """Keeps what the processes of tasks wrote, in case it is needed."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(getattr(record, "fields", {}).get("output", record.getMessage()))


def run_task(
    kind: JobKind[RequestT, ResultT],
    request: RequestT,
    inputs: Mapping[str, Path],
    folder: Path,
    run: RunContext | None = None,
    engine: Engine | None = None,
) -> ResultT:
    """Do one piece of work in a process of its own, with progress on standard error.

    ``folder`` exists and is empty; what the work writes is left in it. The first Ctrl-C (or
    TERM) cancels. ``engine``: who runs it, a process of this program without one.
    """
    require_files(inputs.values())
    whole = {role: path.resolve() for role, path in inputs.items()}
    task = Task(kind, request, folder.resolve(), whole, run or RunContext())
    with cancel_on_signal() as cancel, show_progress() as report:
        return (engine or ProcessEngine()).run(task, report, cancel)


def processes(asked: int | None) -> int:
    """How many processes may be used: as asked, or one per core."""
    return asked or os.cpu_count() or 1


def require_files(paths: Iterable[Path]) -> None:
    """Raise :class:`InputError` for the first that is no file that can be read."""
    for path in paths:
        _require_file(path)


def _require_file(path: Path) -> None:
    if not path.exists():
        raise InputError("no-file", f"there is no file {path}", "check the path")
    if path.is_dir():
        raise InputError("no-file", f"{path} is a folder", "give a file")
    if not path.is_file():
        # Reading a pipe would wait for somebody to write into it.
        raise InputError("no-file", f"{path} is no plain file", "give a file")
    if not os.access(path, os.R_OK):
        raise InputError("no-file", f"{path} may not be read", "change its permissions")


@contextmanager
def cancel_on_signal() -> Iterator[threading.Event]:
    """An event that Ctrl-C, TERM or a closed terminal sets, instead of ending the program."""
    cancel = threading.Event()

    def ask(_number: int, _frame: FrameType | None) -> None:
        cancel.set()

    before: dict[int, Callable[..., Any] | int | None] = {}
    for number in (int(signal.SIGINT), int(signal.SIGTERM), int(signal.SIGHUP)):
        if number == signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
            continue  # nohup
        before[number] = signal.signal(number, ask)
    try:
        yield cancel
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
