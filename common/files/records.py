"""JSON files of the domain's own dataclasses: strict models made from them, and back."""

from __future__ import annotations

import dataclasses
import functools
import math
import types
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, create_model

from common.files.strict import StrictModel

RecordT = TypeVar("RecordT")


def model_of(record: type) -> type[StrictModel]:
    """The strict model with the fields of a dataclass. Numbers that are not finite are null.

    A field with a default may be left out, so that files from before there was one still read.
    """
    hints = get_type_hints(record)
    # pydantic's signature cannot say that the values are (type, default) pairs.
    fields: dict[str, Any] = {
        f.name: (
            _field_type(hints[f.name]),
            ... if f.default is dataclasses.MISSING else f.default,
        )
        for f in dataclasses.fields(record)
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
