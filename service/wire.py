"""What a task's process and the service say to each other: one JSON object per line."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

from common import errors

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


def plain(value: Any) -> Any:  # noqa: ANN401 - any value that has a JSON form
    """``value`` in JSON's own types; NaN and infinity, which JSON has not, become null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):  # numpy scalars and arrays
        return plain(value.tolist())
    return value


def line(message: dict[str, Any]) -> bytes:
    """One message as it travels."""
    return json.dumps(plain(message), allow_nan=False).encode() + b"\n"
