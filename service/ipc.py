"""What a task's process and the service say to each other: one JSON object per line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from common import errors
from common.files.plain import plain
from common.progress import Progress
from service.jobs.engine import Task
from service.kinds.base import JobKind, RequestT, Result, ResultT, RunContext

_KINDS: dict[str, type[errors.RigwrightError]] = {
    kind.kind: kind
    for kind in (
        errors.InputError,
        errors.TooLargeError,
        errors.NotFoundError,
        errors.ConflictError,
        errors.UnsatisfiableError,
        errors.DeviceError,
        errors.InterlockError,
        errors.CancelledError,
        errors.InternalError,
    )
}


def error_fields(error: errors.RigwrightError) -> dict[str, str]:
    """An error as a JSON object."""
    return {
        "kind": error.kind,
        "detail": error.detail,
        "problem": error.problem,
        "remedy": error.remedy,
    }


def error_from_fields(fields: dict[str, str]) -> errors.RigwrightError:
    """The error that :func:`error_fields` wrote down."""
    return _KINDS[fields["kind"]](fields["detail"], fields["problem"], fields["remedy"])


def task_line(task: Task[RequestT, ResultT]) -> bytes:
    """A task as its process reads it."""
    kind = task.kind
    return _line(
        {
            "kind": kind.name,
            "memory_limit_bytes": kind.memory_limit_bytes,
            "request": kind.row(task.request, RunContext()),
            "run": task.run.model_dump(mode="json"),
            "inputs": {role: str(path) for role, path in task.inputs.items()},
            "folder": str(task.folder),
        }
    )


class TaskMessage:
    """A task as it came: what kind it is of tells how to read the rest."""

    def __init__(self, text: bytes) -> None:
        self._fields = json.loads(text)
        self.kind_name = str(self._fields["kind"])
        self.memory_limit_bytes: int | None = self._fields["memory_limit_bytes"]

    def task(self, kind: JobKind[RequestT, ResultT]) -> Task[RequestT, ResultT]:
        """The task. Raises :class:`~common.errors.InternalError` for another version's."""
        request, _ = kind.from_row(self._fields["request"])
        inputs = {role: Path(path) for role, path in self._fields["inputs"].items()}
        run = RunContext.model_validate(self._fields["run"])
        return Task(kind, request, Path(self._fields["folder"]), inputs, run)


def progress_line(progress: Progress) -> bytes:
    """Progress on its way to the service."""
    return _line({"progress": plain(progress)})


def progress_from_fields(fields: dict[str, Any]) -> Progress:
    """Progress again; cost and violation are NaN where JSON had null."""
    nan = float("nan")
    numbers = {key: nan if fields[key] is None else fields[key] for key in ("cost", "violation")}
    return Progress(**{**fields, **numbers})


def outcome_line(outcome: Result | errors.RigwrightError) -> bytes:
    """How a task ended, on its way to the service."""
    if isinstance(outcome, errors.RigwrightError):
        return _line({"error": error_fields(outcome)})
    return _line({"result": outcome.model_dump(mode="json", by_alias=True)})


def message_from_line(
    text: bytes, kind: JobKind[RequestT, ResultT]
) -> Progress | ResultT | errors.RigwrightError:
    """What a task said: progress, its result, or its error."""
    message = json.loads(text)
    if "progress" in message:
        return progress_from_fields(message["progress"])
    if "error" in message:
        return error_from_fields(message["error"])
    return kind.result.model_validate_json(json.dumps(message["result"]))


def _line(message: dict[str, Any]) -> bytes:
    return json.dumps(plain(message), allow_nan=False).encode() + b"\n"
