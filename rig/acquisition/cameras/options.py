"""Options of backends as they stand in a station file, checked; and what is not installed."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from typing import TypeVar

from pydantic import ValidationError

from common.errors import DeviceError, InputError
from common.files.strict import StrictModel, keys_of

OptionsT = TypeVar("OptionsT", bound=StrictModel)


def read_options(backend: str, model: type[OptionsT], given: Mapping[str, object]) -> OptionsT:
    """The options of a backend. InputError names the first one that is wrong."""
    try:
        return model.model_validate(given, strict=False)
    except ValidationError as error:
        # A misspelt key first: the key that is "missing" then is most often the same one.
        wrong = sorted(error.errors(), key=lambda one: one["type"] != "extra_forbidden")
        first = wrong[0]
        where = ".".join(str(part) for part in first["loc"]) or "options"
        raise InputError(
            "camera-option",
            f"option '{where}' of the {backend} cameras: {first['msg']}",
            f"its options are {', '.join(keys_of(model)) or 'none'}",
        ) from None


def require(backend: str, module: str, install: str) -> None:
    """Raise ``device/backend-missing`` unless ``module`` can be imported."""
    if importlib.util.find_spec(module) is None:
        raise missing(backend, f"the Python package '{module}' is not installed", install)


def missing(backend: str, problem: str, install: str) -> DeviceError:
    """The error of a backend whose library is not there."""
    return DeviceError(
        "backend-missing", f"{backend} cameras cannot be reached: {problem}", f"run: {install}"
    )
