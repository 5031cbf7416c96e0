"""Backends by name. None is imported before it is asked for: most need a library of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from common.errors import InputError, RigwrightError
from rig.acquisition.cameras.base import CameraBackend, CameraInfo

Options = Mapping[str, object]
SIMULATED = "simulated"
"""Cameras of a whole station that are computed: no backend by itself, its options are none."""


def _folder(options: Options) -> CameraBackend:
    from rig.acquisition.cameras.folder import FolderBackend

    return FolderBackend(**options)


def _opencv(options: Options) -> CameraBackend:
    from rig.acquisition.cameras.opencv import OpencvBackend

    return OpencvBackend(**options)


def _genicam(options: Options) -> CameraBackend:
    from rig.acquisition.cameras.genicam import GenicamBackend

    return GenicamBackend(**options)


def _aravis(options: Options) -> CameraBackend:
    from rig.acquisition.cameras.aravis import AravisBackend

    return AravisBackend(**options)


def _gphoto2(options: Options) -> CameraBackend:
    from rig.acquisition.cameras.gphoto2 import GphotoBackend

    return GphotoBackend(**options)


BACKENDS: Mapping[str, Callable[[Options], CameraBackend]] = {
    "folder": _folder,
    "opencv": _opencv,
    "genicam": _genicam,
    "aravis": _aravis,
    "gphoto2": _gphoto2,
}
"""Drivers by their name in station files. Adding one is adding a line."""

ON_THEIR_OWN = ("opencv", "genicam", "aravis", "gphoto2")
"""Backends that find cameras without being told where."""


def make_backend(name: str, options: Options | None = None) -> CameraBackend:
    """A backend with its options as they stand in a station file.

    InputError for an unknown name or option; DeviceError ``device/backend-missing``, with the
    command that installs it, where its library is not there.
    """
    if name not in BACKENDS:
        raise InputError(
            "camera-backend",
            f"there is no camera backend '{name}'",
            f"choose one of {', '.join((SIMULATED, *BACKENDS))}",
        )
    return BACKENDS[name](options or {})


@dataclass(frozen=True)
class Discovery:
    """What was found. ``problems``: backend and why it could not look, for all that could not."""

    cameras: tuple[CameraInfo, ...]
    problems: Mapping[str, str] = field(default_factory=dict)


def discover_all(
    options: Mapping[str, Options] | None = None,
) -> Discovery:
    """Look for cameras in every way at once, each backend by itself.

    ``options`` are those of single backends; ``folder`` looks only when it has some. A backend
    whose library is missing is a line in ``problems``, never an error.
    """
    given = options or {}
    names = [name for name in BACKENDS if name in given or name in ON_THEIR_OWN]
    with ThreadPoolExecutor(max_workers=len(names)) as pool:
        looks = list(pool.map(lambda name: _look(name, given.get(name, {})), names))
    cameras = [info for found, _ in looks for info in found]
    problems = {name: why for name, (_, why) in zip(names, looks, strict=True) if why}
    return Discovery(tuple(cameras), problems)


def _look(name: str, options: Options) -> tuple[tuple[CameraInfo, ...], str]:
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
