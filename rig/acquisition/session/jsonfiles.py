"""Records to bytes and back: stable JSON, so that the same content has the same checksum."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

from common.errors import InputError
from common.files.strict import StrictModel, validated
from rig.acquisition.session.records import FileEntry, SessionFile
from rig.acquisition.session.storage import sha256

ModelT = TypeVar("ModelT", bound=StrictModel)


def plain(value: Any) -> Any:  # noqa: ANN401  any value in, JSON's own out
    """JSON's own for a value: dataclasses as mappings, NaN and infinity as null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = dataclasses.fields(value)
        return {field.name: plain(getattr(value, field.name)) for field in fields}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def json_bytes(document: object) -> bytes:
    """A JSON file: readable, never NaN, the same bytes for the same content."""
    text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
    return (text + "\n").encode()


def model_bytes(model: StrictModel) -> bytes:
    """A record as a JSON file."""
    return json_bytes(model.model_dump(mode="json", by_alias=True))


def read_model(model: type[ModelT], data: bytes, source: str) -> ModelT:
    """A record from a JSON file; raises a one-line :class:`InputError` that names ``source``."""
    try:
        document = json.loads(data)
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise InputError(
            "session-not-json", f"{source} is not JSON", "restore it from a copy"
        ) from error
    return validated(model, document, source)


def signed(session: SessionFile) -> SessionFile:
    """The same with its digest set."""
    return session.model_copy(update={"digest": digest(session)})


def digest(session: SessionFile) -> str:
    """The checksum of a session's content without the digest itself."""
    return sha256(model_bytes(session.model_copy(update={"digest": ""})))


def entry(path: str | Path, data: bytes) -> FileEntry:
    """How a file with these bytes is listed."""
    return FileEntry(path=Path(path).as_posix(), sha256=sha256(data), bytes=len(data))
