"""Files read strictly: the pydantic base of every file, and its one-line errors.

Unknown keys, NaN, and values of another type are errors. A misspelt key is answered with the
nearest that the file may have there.
"""

from __future__ import annotations

import codecs
import dataclasses
import json
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar, get_args, get_type_hints

from annotated_types import Len
from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from common.errors import InputError
from common.words import did_you_mean

Pair = Annotated[list[float], Len(2, 2)]
Vector = Annotated[list[float], Len(3, 3)]
Matrix = Annotated[list[Vector], Len(3, 3)]
CameraName = Annotated[str, Field(pattern=r"^\w[\w .\-]{0,79}$")]
"""Letters, digits, spaces, dots, hyphens: names end up in file names, tables and pages."""

ModelT = TypeVar("ModelT", bound=BaseModel)
RecordT = TypeVar("RecordT")

STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class StrictModel(BaseModel):
    """Unknown keys, NaN, and values of another type are errors: a misspelt key must not vanish."""

    model_config = STRICT


def key_of(name: str, model: type[BaseModel]) -> str:
    """The key as it stands in the file for a field of ``model``."""
    return model.model_fields[name].alias or name


def child_model(model: type[BaseModel], key: str) -> type[BaseModel] | None:
    """The model behind a key, seen through optional values and lists."""
    found = _table_in(_tables(model).get(key))
    return found if found is not None and issubclass(found, BaseModel) else None


def keys_of(table: type) -> list[str]:
    """All keys of a model or dataclass, as they stand in the file."""
    return list(_tables(table))


def _tables(table: type) -> dict[str, Any]:
    """What stands behind each key of a model or dataclass."""
    if issubclass(table, BaseModel):
        return {key_of(n, table): f.annotation for n, f in table.model_fields.items()}
    hints = get_type_hints(table)
    fields = dataclasses.fields(table) if dataclasses.is_dataclass(table) else ()
    return {f.name: hints[f.name] for f in fields}


def _table_in(annotation: object) -> type | None:
    """The first model or dataclass within an annotation."""
    if isinstance(annotation, type) and (
        issubclass(annotation, BaseModel) or dataclasses.is_dataclass(annotation)
    ):
        return annotation
    found = (_table_in(part) for part in get_args(annotation))
    return next((table for table in found if table is not None), None)


def unknown_key(table: type, location: tuple[int | str, ...]) -> str:
    """A remedy for a key at ``location`` that ``table`` does not have: the nearest that it has."""
    owner: type | None = table
    for part in location[:-1]:
        # A name that is no key is one within a mapping: the mapping's own key gave its kind.
        if isinstance(part, str) and owner is not None and part in _tables(owner):
            owner = _table_in(_tables(owner)[part])
    keys = keys_of(owner) if owner is not None else []
    otherwise = f"the keys here are {', '.join(keys)}" if keys else "remove it"
    return did_you_mean(str(location[-1]), keys, otherwise)


def _spell(location: tuple[int | str, ...]) -> str:
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.removeprefix(".") or "the file"


def _given(value: object) -> str:
    try:
        text = repr(value)
    except (ValueError, RecursionError):
        return "too long, or nested too deeply, to be shown"
    return text if len(text) <= 40 else f"{text[:37]}..."


_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
_MISSING = ("missing", "missing_argument")


def one_line(error: ValidationError, table: type, source: str) -> InputError:
    """The most telling of pydantic's findings as an :class:`InputError`.

    Another kind of file comes first, for it misspells every key; then a misspelt key, for it
    makes another seem missing.
    """
    findings = sorted(
        error.errors(), key=lambda e: (e["loc"] != ("schema",), e["type"] not in _UNKNOWN)
    )
    first, others = findings[0], len(findings) - 1
    where = f"{source}: {_spell(first['loc'])}" if source else _spell(first["loc"])
    if first["type"] == "json_invalid":
        return InputError("file-json", f"{source} is not JSON", "give the file as it was written")
    more = f" ({others} more to mend after it)" if others else ""
    if first["type"] in _UNKNOWN:
        remedy = unknown_key(table, first["loc"])
        return InputError("key-unknown", f"{where} is not known{more}", remedy)
    if first["type"] in _MISSING:
        return InputError("key-missing", f"{where} is missing{more}", "add it")
    message = first["msg"].removeprefix("Value error, ")
    message = message[:1].lower() + message[1:].replace("Input", "it")
    message = message.replace("input should", "it should")
    given = "" if isinstance(first["input"], Mapping) else f" is {_given(first['input'])}"
    return InputError("value", f"{where}{given}{more}", message)


def validated(
    model: type[ModelT], data: object, source: str, context: Mapping[str, object] | None = None
) -> ModelT:
    """``data`` as a ``model``; raises a one-line :class:`InputError` that names ``source``.

    ``context`` reaches the model's own validators.
    """
    try:
        return model.model_validate(data, context=None if context is None else dict(context))
    except ValidationError as error:
        raise one_line(error, model, source) from error


def parsed(model: type[ModelT], text: str | bytes, source: str) -> ModelT:
    """A file's JSON text as a ``model``; raises a one-line :class:`InputError` naming ``source``.

    Strict as JSON is: its lists serve for tuples, its texts for paths.
    """
    if isinstance(text, bytes):
        text = text.removeprefix(codecs.BOM_UTF8)
    try:
        return model.model_validate_json(text)
    except ValidationError as error:
        raise one_line(error, model, source) from error


def as_json(model: type[ModelT], data: Mapping[str, Any], source: str) -> ModelT:
    """``data`` of a TOML file as a ``model``, with lists for its tuples and texts for its paths.

    Strict Python input would want tuples and paths, which TOML does not have.
    """
    return parsed(model, _as_json(data, source), source)


def _as_json(data: object, source: str) -> str:
    try:
        return json.dumps(data, default=str)
    except (ValueError, RecursionError) as error:
        problem = f"{source} has a number that is too long, or is nested too deeply"
        raise InputError("value", problem, "mend it") from error


def section_of(kind: type[RecordT], data: Mapping[str, Any], section: str) -> RecordT:
    """A dataclass from a file's section; raises a one-line :class:`InputError` naming both."""
    # A dataclass within a model is read under the model's configuration, strictness included.
    fields: dict[str, Any] = {section: (kind, ...)}
    holder = create_model("Holder", __config__=STRICT, **fields)
    try:
        # As JSON, for the reason above.
        read = holder.model_validate_json(_as_json({section: data}, section))
    except ValidationError as error:
        raise one_line(error, holder, "") from error
    value: RecordT = getattr(read, section)
    return value
