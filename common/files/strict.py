"""The pydantic base of every file this package reads, and its one-line errors."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Annotated, TypeVar, get_args

from annotated_types import Len
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from common.errors import InputError

Pair = Annotated[list[float], Len(2, 2)]
Vector = Annotated[list[float], Len(3, 3)]
Matrix = Annotated[list[Vector], Len(3, 3)]
CameraName = Annotated[str, Field(pattern=r"^\w[\w .\-]{0,79}$")]
"""Letters, digits, spaces, dots, hyphens: names end up in file names, tables and pages."""

ModelT = TypeVar("ModelT", bound=BaseModel)


class StrictModel(BaseModel):
    """Unknown keys, NaN, and values of another type are errors: a misspelt key must not vanish."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


def key_of(name: str, model: type[BaseModel]) -> str:
    """The key as it stands in the file for a field of ``model``."""
    return model.model_fields[name].alias or name


def keys_of(model: type[BaseModel]) -> list[str]:
    """All keys of a model, as they stand in the file."""
    return [key_of(name, model) for name in model.model_fields]


def child_model(model: type[BaseModel], key: str) -> type[BaseModel] | None:
    """The model behind a key, seen through optional values and lists."""
    for name, info in model.model_fields.items():
        if key_of(name, model) == key:
            return _model_in(info.annotation)
    return None


def _model_in(annotation: object) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = (_model_in(part) for part in get_args(annotation))
    return next((model for model in found if model is not None), None)


def _spell(location: tuple[int | str, ...]) -> str:
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.removeprefix(".") or "the file"


def unknown_key(model: type[BaseModel], location: tuple[int | str, ...]) -> str:
    """A remedy for a key at ``location`` that a model does not have: the nearest that it has."""
    owner: type[BaseModel] | None = model
    for part in location[:-1]:
        if isinstance(part, str) and owner is not None:
            owner = child_model(owner, part)
    keys = keys_of(owner) if owner is not None else []
    close = difflib.get_close_matches(str(location[-1]), keys, 1, 0.5)
    return f"did you mean {close[0]}?" if close else f"the keys here are {', '.join(keys)}"


def _given(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def one_line(error: ValidationError, model: type[BaseModel], source: str) -> InputError:
    """The most telling of pydantic's findings as an :class:`InputError`.

    A misspelt key comes first: it often makes another key seem missing.
    """
    findings = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    first, others = findings[0], len(findings) - 1
    where, message = _spell(first["loc"]), first["msg"].removeprefix("Value error, ")
    more = f" ({others} more to mend after it)" if others else ""
    if first["type"] == "extra_forbidden":
        remedy = unknown_key(model, first["loc"])
        return InputError("key-unknown", f"{source}: {where} is not known{more}", remedy)
    if first["type"] == "missing":
        return InputError("key-missing", f"{source}: {where} is missing{more}", "add it")
    message = message[:1].lower() + message[1:].replace("Input", "it")
    message = message.replace("input should", "it should")
    given = "" if isinstance(first["input"], Mapping) else f" is {_given(first['input'])}"
    return InputError("value", f"{source}: {where}{given}{more}", message)


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
