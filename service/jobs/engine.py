"""The seam between the service and whatever runs its work.

The service gives an engine a :class:`Task` and hears progress until the work has ended. Today
the engine is a process per task on this machine; another one (a cluster) has to keep to the
same few lines. An engine keeps no state that matters: the books are in the store.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from common.progress import CancelToken


@dataclass(frozen=True)
class JobKind:
    """A kind of work.

    ``entry`` is ``module:function``, called in the process of the task as
    ``function(request, inputs, folder, report, cancel) -> result``. What the function writes
    into ``folder`` is kept as the job's files. ``time_limit_s`` and ``memory_limit_bytes``
    (address space) end work that takes too much; None: no limit.
    """

    name: str
    entry: str
    time_limit_s: float | None = None
    memory_limit_bytes: int | None = None


@dataclass(frozen=True)
class Task:
    """One piece of work. ``inputs`` are files by role; ``folder`` is empty and its own."""

    kind: JobKind
    request: Mapping[str, Any]
    folder: Path
    inputs: Mapping[str, Path] = field(default_factory=dict)


Report = Callable[[dict[str, Any]], None]
"""Receives progress as a JSON object."""


class Engine(Protocol):
    """Runs tasks."""

    def run(self, task: Task, report: Report, cancel: CancelToken) -> dict[str, Any]:
        """The task's result, a JSON object; returns only when nothing of the task runs any more.

        Raises the :class:`~common.errors.RigwrightError` that the work raised,
        :class:`~common.errors.CancelledError` when ``cancel`` ended it,
        :class:`~common.errors.TooLargeError` when it went over its time or memory, and
        :class:`~common.errors.InternalError` when it died.
        """
        ...
