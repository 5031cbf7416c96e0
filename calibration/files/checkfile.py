"""``check.json``: one check; and the history of many."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from calibration.check.verdicts import CheckResult
from calibration.files.strict import StrictModel, model_of, parsed, plain, record_of
from calibration.files.writing import read_limited, write_whole

CHECK_SCHEMA = "rigwright.check/1"

ResultModel: Any = model_of(CheckResult)


class CheckModel(StrictModel):
    """The whole file."""

    schema_: Literal["rigwright.check/1"]
    reference: str
    made_utc: str
    result: ResultModel

    model_config = StrictModel.model_config | {"alias_generator": lambda n: n.removesuffix("_")}


@dataclass(frozen=True)
class CheckRecord:
    """A check with the name of its reference and the time it was made, UTC as text (ISO 8601)."""

    reference: str
    made_utc: str
    result: CheckResult


def check_document(record: CheckRecord) -> dict[str, Any]:
    """The file as plain data."""
    return {
        "schema": CHECK_SCHEMA,
        "reference": record.reference,
        "made_utc": record.made_utc,
        "result": plain(record.result),
    }


def check_from(text: str | bytes, source: str) -> CheckRecord:
    """A check from a file's text; raises a one-line :class:`InputError`."""
    model = parsed(CheckModel, text, source)
    return CheckRecord(model.reference, model.made_utc, record_of(CheckResult, model.result))


def write_check(path: Path, record: CheckRecord, overwrite: bool = False) -> None:
    """Writes ``check.json``, whole or not at all."""
    text = json.dumps(check_document(record), allow_nan=False, ensure_ascii=False) + "\n"
    write_whole(path, text.encode(), overwrite)


def read_check(path: Path) -> CheckRecord:
    """Reads ``check.json``; raises a one-line :class:`InputError`."""
    return check_from(read_limited(path), path.name)
