"""How a command runs its work, shows its errors and keeps half-written folders away."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import typer

from common.errors import InputError, InternalError, RigwrightError
from service.cli.progress import show_progress
from service.jobs.engine import JobKind, Task
from service.jobs.process import ProcessEngine
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
    except RigwrightError as error:
        if isinstance(error, InternalError):
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
    entry: str, request: Mapping[str, Any], inputs: Mapping[str, Path], folder: Path
) -> dict[str, Any]:
    """Do one piece of work in a process of its own, with progress on standard error.

    ``folder`` exists and is empty; what the work writes is left in it. The first Ctrl-C (or
    TERM) cancels.
    """
    for path in inputs.values():
        _require_file(path)
    whole = {role: path.resolve() for role, path in inputs.items()}
    task = Task(JobKind("command", entry), request, folder.resolve(), whole)
    with cancel_on_signal() as cancel, show_progress() as report:
        return ProcessEngine().run(task, report, cancel)


def _require_file(path: Path) -> None:
    if not path.exists():
        raise InputError("no-file", f"there is no file {path}", "check the path")
    if path.is_dir():
        raise InputError("no-file", f"{path} is a folder", "give a file")
    if not os.access(path, os.R_OK):
        raise InputError("no-file", f"{path} may not be read", "change its permissions")


@contextmanager
def cancel_on_signal() -> Iterator[threading.Event]:
    """An event that Ctrl-C or TERM sets, instead of ending the program."""
    cancel = threading.Event()

    def ask(_number: int, _frame: FrameType | None) -> None:
        cancel.set()

    before: dict[int, Callable[..., Any] | int | None] = {}
    for number in (int(signal.SIGINT), int(signal.SIGTERM)):
        before[number] = signal.signal(number, ask)
    try:
        yield cancel
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
