"""The ``[simulation]`` section: the simulated backend's own settings, read strictly too."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from common.errors import InputError
from common.files.strict import section_of
from geometry.camera import RigCamera
from rig.acquisition.cameras.base import CameraBackend
from rig.acquisition.capture.rigfacts import read_rig_design
from rig.acquisition.station.spec import Station
from rig.acquisition.trigger.box import ReportSource
from rig.simulation.settings import SimulationSettings


def simulated_backend(
    station: Station, box: ReportSource | None, options: Mapping[str, Any]
) -> CameraBackend:
    """The station's cameras, simulated. ``options``: it has none; InputError for any."""
    # Imported here: rendering is heavy, and stations of real cameras need nothing of it.
    from rig.simulation.backend import SimulatedBackend

    if options:
        raise InputError(
            "camera-option",
            f"option '{next(iter(options))}' of the simulated cameras is not known",
            "what they see and do stands in [simulation]",
        )
    cameras = list(simulated_cameras(station).values())
    return SimulatedBackend(cameras, simulation_settings(station), box)


def simulated_cameras(station: Station) -> Mapping[str, RigCamera]:
    """What the simulated backend has to know of its cameras: where they stand and what they are.

    Raises :class:`InputError` for a station without a design.
    """
    design = read_rig_design(station)
    if not design.cameras:
        raise InputError(
            "station-no-design",
            "simulated cameras need a design, which says where they stand",
            'make one with `rigwright design` and name it: design = "design.json"',
        )
    return design.cameras


def simulation_settings(station: Station) -> SimulationSettings:
    """The settings of a station's simulated cameras.

    Files are looked for beside the station file; the timing board and its line are those of
    ``[led]`` where the section does not say. Raises a one-line :class:`InputError`.
    """
    data = _with_wiring(dict(station.simulation or {}), station)
    settings = section_of(SimulationSettings, data, "simulation")
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
