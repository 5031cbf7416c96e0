"""Strict reading of JSON files: models made from the domain's own dataclasses, one-line errors."""

from __future__ import annotations

import dataclasses
import difflib
import functools
import math
import types
from enum import Enum
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError, create_model

from common.errors import InputError

ModelT = TypeVar("ModelT", bound=BaseModel)
RecordT = TypeVar("RecordT")


class StrictModel(BaseModel):
    """Unknown keys, NaN, and values of another type are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


def model_of(record: type) -> type[StrictModel]:
    """The strict model with the fields of a dataclass. Numbers that are not finite are null."""
    hints = get_type_hints(record)
    # pydantic's signature cannot say that the values are (type, default) pairs.
    fields: dict[str, Any] = {
        f.name: (_field_type(hints[f.name]), ...) for f in dataclasses.fields(record)
    }
    return create_model(record.__name__, __base__=StrictModel, **fields)


def _field_type(hint: Any) -> Any:  # noqa: ANN401 - any annotation may come and go
    if hint is float:
        return float | None
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return model_of(hint)
    inner = get_args(hint)
    if get_origin(hint) is tuple:
        kinds = tuple(i if i is Ellipsis else _field_type(i) for i in inner)
        return tuple.__class_getitem__(kinds)
    if get_origin(hint) in (Union, types.UnionType):
        return functools.reduce(lambda a, b: a | b, (_field_type(i) for i in inner))
    return hint


def record_of(record: type[RecordT], model: BaseModel) -> RecordT:
    """The dataclass back from its model; null numbers become NaN."""
    hints = get_type_hints(record)
    values = {
        f.name: _value(hints[f.name], getattr(model, f.name))
        for f in dataclasses.fields(record)  # type: ignore[arg-type]
    }
    return record(**values)


def _value(hint: Any, value: Any) -> Any:  # noqa: ANN401 - any annotation, any value
    if hint is float:
        return math.nan if value is None else value
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return record_of(hint, value)
    inner = get_args(hint)
    if get_origin(hint) is tuple:
        kinds = inner if Ellipsis not in inner else (inner[0],) * len(value)
        return tuple(_value(k, v) for k, v in zip(kinds, value, strict=True))
    if get_origin(hint) in (Union, types.UnionType) and value is not None:
        return _value(next(i for i in inner if i is not type(None)), value)
    return value


def plain(value: Any) -> Any:  # noqa: ANN401 - anything a record may hold
    """Records, tuples and enums as JSON has them; numbers that are not finite as null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, tuple | list):
        return [plain(v) for v in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def parsed(model: type[ModelT], text: str | bytes, source: str) -> ModelT:
    """A file's text as a ``model``; raises a one-line :class:`InputError` naming ``source``."""
    try:
        return model.model_validate_json(text)
    except ValidationError as error:
        raise one_line(error, model, source) from error


def one_line(error: ValidationError, model: type[BaseModel], source: str) -> InputError:
    """The most telling finding: another kind of file, then a misspelt key, then the rest."""
    # A misspelt key makes another seem missing, and another kind of file misspells them all.
    found = sorted(
        error.errors(), key=lambda e: (e["loc"] != ("schema",), e["type"] != "extra_forbidden")
    )
    first, more = found[0], f" ({len(found) - 1} more after it)" if len(found) > 1 else ""
    where = ".".join(str(part) for part in first["loc"]) or "the file"
    if first["type"] == "json_invalid":
        return InputError("file-json", f"{source} is not JSON", "give the file as it was written")
    if first["type"] == "extra_forbidden":
        close = difflib.get_close_matches(str(first["loc"][-1]), _keys_of(model), 1, 0.5)
        remedy = f"did you mean {close[0]}?" if close else "remove it"
        return InputError("key-unknown", f"{source}: {where} is not known{more}", remedy)
    if first["type"] == "missing":
        return InputError("key-missing", f"{source}: {where} is missing{more}", "add it")
    message = first["msg"].removeprefix("Value error, ")
    remedy = message[:1].lower() + message[1:].replace("Input should", "it should")
    return InputError("value", f"{source}: {where} cannot be used{more}", remedy)


def _keys_of(model: type[BaseModel]) -> list[str]:
    """All keys that a file may have, however deep."""
    found: dict[str, None] = {}
    waiting: list[Any] = [model]
    while waiting:
        kind = waiting.pop()
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            found.update({info.alias or name: None for name, info in kind.model_fields.items()})
            waiting += [info.annotation for info in kind.model_fields.values()]
        else:
            waiting += get_args(kind)
    return list(found)
