"""Backends by name. None is imported before it is asked for: most need a library of their own."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import cast

from common.errors import InputError, RigwrightError
from rig.acquisition.cameras.base import CameraBackend, CameraInfo

BACKENDS: Mapping[str, str] = {
    "simulated": "rig.simulation.backend:SimulatedBackend",
    "folder": "rig.acquisition.cameras.folder:FolderBackend",
    "opencv": "rig.acquisition.cameras.opencv:OpencvBackend",
    "genicam": "rig.acquisition.cameras.genicam:GenicamBackend",
    "aravis": "rig.acquisition.cameras.aravis:AravisBackend",
    "gphoto2": "rig.acquisition.cameras.gphoto2:GphotoBackend",
}
"""Name in station files, then module and class. Adding a backend is adding a line."""

ON_THEIR_OWN = ("opencv", "genicam", "aravis", "gphoto2")
"""Backends that find cameras without being told where."""


def make_backend(name: str, options: Mapping[str, object] | None = None) -> CameraBackend:
    """A backend with its options as they stand in a station file.

    InputError for an unknown name or option; DeviceError ``device/backend-missing``, with the
    command that installs it, where its library is not there.
    """
    if name not in BACKENDS:
        raise InputError(
            "camera-backend",
            f"there is no camera backend '{name}'",
            f"choose one of {', '.join(BACKENDS)}",
        )
    module, _, factory = BACKENDS[name].partition(":")
    made = getattr(importlib.import_module(module), factory)(**(options or {}))
    return cast("CameraBackend", made)


@dataclass(frozen=True)
class Discovery:
    """What was found. ``problems``: backend and why it could not look, for all that could not."""

    cameras: tuple[CameraInfo, ...]
    problems: Mapping[str, str] = field(default_factory=dict)


def discover_all(
    options: Mapping[str, Mapping[str, object]] | None = None,
) -> Discovery:
    """Look for cameras in every way at once, each backend by itself.

    ``options`` are those of single backends; ``folder`` and ``simulated`` look only when they
    have some. A backend whose library is missing is a line in ``problems``, never an error.
    """
    given = options or {}
    names = [name for name in BACKENDS if name in given or name in ON_THEIR_OWN]
    with ThreadPoolExecutor(max_workers=len(names)) as pool:
        looks = list(pool.map(lambda name: _look(name, given.get(name, {})), names))
    cameras = [info for found, _ in looks for info in found]
    problems = {name: why for name, (_, why) in zip(names, looks, strict=True) if why}
    return Discovery(tuple(cameras), problems)


def _look(name: str, options: Mapping[str, object]) -> tuple[tuple[CameraInfo, ...], str]:
    try:
        backend = make_backend(name, options)
    except RigwrightError as error:
        return (), str(error)
    try:
        return tuple(backend.discover()), ""
    except RigwrightError as error:
        return (), str(error)
    finally:
        backend.close()
