"""What a task's process and the service say to each other: one JSON object per line."""

from __future__ import annotations

import json
from typing import Any

from common import errors
from common.files.plain import plain

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


def line(message: dict[str, Any]) -> bytes:
    """One message as it travels."""
    return json.dumps(plain(message), allow_nan=False).encode() + b"\n"
