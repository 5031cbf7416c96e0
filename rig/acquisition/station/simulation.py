"""The ``[simulation]`` section: the simulated backend's own settings, read strictly too."""

from __future__ import annotations

import dataclasses
import difflib
import json
import typing
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ConfigDict, ValidationError, create_model

from common.errors import InputError
from rig.acquisition.station.spec import Station

if TYPE_CHECKING:
    from rig.simulation.settings import SimulationSettings

STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def simulation_settings(station: Station) -> SimulationSettings:
    """The settings of a station's simulated cameras.

    Files are looked for beside the station file; the timing board and its line are those of
    ``[led]`` where the section does not say. Raises a one-line :class:`InputError`.
    """
    # Imported here: stations of real cameras need nothing of the simulation.
    from rig.simulation.settings import SimulationSettings

    data = _with_wiring(dict(station.simulation or {}), station)
    settings = read_settings(SimulationSettings, data)
    folder = Path() if station.path is None else station.path.parent
    return typing.cast("SimulationSettings", _located(settings, folder))


def _with_wiring(data: dict[str, Any], station: Station) -> dict[str, Any]:
    outputs = {c.name: c.output for c in station.cameras if c.output is not None}
    data.setdefault("outputs", outputs)
    scene = data.get("scene")
    board = scene.get("board") if isinstance(scene, Mapping) else None
    if isinstance(scene, Mapping) and isinstance(board, Mapping):
        given = dict(board)
        if station.board is not None:
            given.setdefault("board", asdict(station.board))
        if station.leds:
            given.setdefault("sync_output", station.leds[0].output)
        data["scene"] = {**scene, "board": given}
    return data


def read_settings(kind: type[Any], data: Mapping[str, Any], where: str = "simulation") -> Any:  # noqa: ANN401  an object of ``kind``
    """A frozen settings object of ``kind`` from parsed TOML; unknown keys are errors."""
    # A dataclass within a model is read under the model's configuration, strictness included.
    fields: dict[str, Any] = {where: (kind, ...)}
    holder = create_model("Holder", __config__=STRICT, **fields)
    try:
        # As JSON: strict Python input would want tuples and paths, which TOML does not have.
        return getattr(holder.model_validate_json(json.dumps({where: data}, default=str)), where)
    except ValidationError as error:
        first = min(error.errors(), key=lambda e: e["type"] != "unexpected_keyword_argument")
        key = ".".join(str(part) for part in first["loc"])
        if first["type"] in ("unexpected_keyword_argument", "extra_forbidden"):
            remedy = _nearest(kind, first["loc"][1:])
            raise InputError("key-unknown", f"{key} is not known", remedy) from error
        message = first["msg"].removeprefix("Value error, ")
        raise InputError(
            "value", f"{key}: {message[:1].lower()}{message[1:]}", "mend it"
        ) from error


def _nearest(kind: type[Any], location: tuple[int | str, ...]) -> str:
    owner: type[Any] | None = kind
    for part in location[:-1]:
        owner = _kind_of(owner, str(part)) if owner is not None else None
    keys = [entry.name for entry in dataclasses.fields(owner)] if owner is not None else []
    close = difflib.get_close_matches(str(location[-1]), keys, 1, 0.5)
    if close:
        return f"did you mean {close[0]}?"
    return f"the keys here are {', '.join(keys)}" if keys else "take it out"


def _kind_of(owner: type[Any], key: str) -> type[Any] | None:
    """The dataclass behind a key, seen through optional values and mappings; None: no such."""
    hints = typing.get_type_hints(owner)
    if key not in hints:
        # The name of an entry in a mapping, whose kind the mapping's own key has given already.
        return owner
    hint = hints[key]
    options = (hint, *typing.get_args(hint))
    found = (o for o in options if isinstance(o, type) and dataclasses.is_dataclass(o))
    return next(found, None)


def _located(value: Any, folder: Path) -> Any:  # noqa: ANN401  the same object with its paths found
    """The same settings with relative paths made those of ``folder``."""
    if isinstance(value, Path):
        return folder / value
    if isinstance(value, tuple):
        return tuple(_located(item, folder) for item in value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
        moved = {name: _located(item, folder) for name, item in fields.items()}
        changed = {name: item for name, item in moved.items() if item is not fields[name]}
        return dataclasses.replace(value, **changed) if changed else value
    return value
