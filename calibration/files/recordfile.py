"""A file that holds one record: a check, an acceptance test."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

from pydantic import Field, create_model

from common.files.plain import plain
from common.files.reading import read_limited
from common.files.records import model_of, record_of
from common.files.strict import StrictModel, parsed
from common.files.writing import write_whole

RecordT = TypeVar("RecordT")


class RecordFile(Generic[RecordT]):
    """JSON with the fields of a dataclass beside its ``schema``; numbers not finite are null."""

    def __init__(self, schema: str, record: type[RecordT]) -> None:
        """``schema`` is the value of the key of that name, such as ``rigwright.check/1``."""
        self.schema, self._record = schema, record
        # pydantic's signature cannot say that the value is a (type, field) pair.
        named: dict[str, Any] = {"schema_": (Literal[schema], Field(alias="schema"))}
        self.model: type[StrictModel] = create_model(
            f"{record.__name__}File", __base__=model_of(record), **named
        )

    def document(self, record: RecordT) -> dict[str, Any]:
        """The file as plain data."""
        return {"schema": self.schema, **plain(record)}

    def parse(self, text: str | bytes, source: str) -> RecordT:
        """A record from a file's text; raises a one-line :class:`InputError`."""
        return record_of(self._record, parsed(self.model, text, source))

    def write(self, path: Path, record: RecordT, overwrite: bool = False) -> None:
        """Writes the file, whole or not at all."""
        text = json.dumps(self.document(record), allow_nan=False, ensure_ascii=False) + "\n"
        write_whole(path, text.encode(), overwrite)

    def read(self, path: Path) -> RecordT:
        """Reads the file; raises a one-line :class:`InputError`."""
        return self.parse(read_limited(path), path.name)
