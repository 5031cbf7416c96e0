"""The seam between the service and whatever runs its work.

The service gives an engine a :class:`Task` and hears progress until the work has ended. Today
the engine is a process per task on this machine; another one (a cluster) has to keep to the
same few lines. An engine keeps no state that matters: that is in the store.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, Protocol

from common.progress import CancelToken, ProgressCallback
from service.kinds.base import JobKind, RequestT, ResultT, RunContext


@dataclass(frozen=True)
class Task(Generic[RequestT, ResultT]):
    """One piece of work. ``inputs`` are files by role; ``folder`` is empty and its own.

    What is written into ``folder`` is kept as the job's files.
    """

    kind: JobKind[RequestT, ResultT]
    request: RequestT
    folder: Path
    inputs: Mapping[str, Path] = field(default_factory=dict)
    run: RunContext = field(default_factory=RunContext)


@dataclass(frozen=True)
class Running:
    """A task's means while it runs: how to tell of progress, and whether to stop."""

    report: ProgressCallback
    cancel: CancelToken


@dataclass(frozen=True)
class Work(Generic[RequestT, ResultT]):
    """A kind of job with the function that does it, in the process of the task."""

    kind: JobKind[RequestT, ResultT]
    function: Callable[[Task[RequestT, ResultT], Running], ResultT]


class Engine(Protocol):
    """Runs tasks."""

    def run(
        self, task: Task[RequestT, ResultT], report: ProgressCallback, cancel: CancelToken
    ) -> ResultT:
        """The task's result; returns only when nothing of the task runs any more.

        Raises the :class:`~common.errors.RigwrightError` that the work raised,
        :class:`~common.errors.CancelledError` when ``cancel`` ended it,
        :class:`~common.errors.TooLargeError` when it went over its time or memory, and
        :class:`~common.errors.InternalError` when it died.
        """
        ...
