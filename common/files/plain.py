"""Objects in JSON's own types."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from enum import Enum
from typing import Any


def plain(value: Any) -> Any:  # noqa: ANN401 - any value that has a JSON form
    """``value`` in JSON's own types; NaN and infinity, which JSON has not, become null.

    Dataclasses and mappings become objects, enums their values, tuples and arrays lists. What
    has no such form comes back as it is, for the writer of JSON to refuse.
    """
    if isinstance(value, Enum):
        return plain(value.value)
    if isinstance(value, float):
        # A float of numpy is a float too; JSON takes only Python's own.
        return number(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):  # numpy scalars and arrays
        return plain(value.tolist())
    return value


def number(value: float) -> float | None:
    """A JSON number; None for NaN and infinity, which JSON does not know."""
    given = float(value)
    return given if math.isfinite(given) else None
