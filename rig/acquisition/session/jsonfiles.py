"""Records to bytes and back: stable JSON, so that the same content has the same checksum."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TypeVar

from common.errors import InputError
from common.files.reading import json_data
from common.files.strict import StrictModel, validated
from rig.acquisition.session.records import FileEntry, SessionFile
from rig.acquisition.session.storage import sha256

ModelT = TypeVar("ModelT", bound=StrictModel)


def json_bytes(document: object) -> bytes:
    """A JSON file: readable, never NaN, the same bytes for the same content.

    What is no text in it is replaced: a name is not worth a capture.
    """
    text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
    return (text + "\n").encode("utf-8", "replace")


def model_bytes(model: StrictModel) -> bytes:
    """A record as a JSON file."""
    return json_bytes(model.model_dump(mode="json", by_alias=True))


def read_model(model: type[ModelT], data: bytes, source: str) -> ModelT:
    """A record from a JSON file; raises a one-line :class:`InputError` that names ``source``."""
    try:
        document = json_data(data)
    except ValueError as error:
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
