"""Aravis in our words: its errors, its features, its names of pixel formats."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import Any, Optional

import gi

from common.errors import DeviceError
from rig.acquisition.cameras.workers import features

gi.require_version("Aravis", "0.8")
from gi.repository import Aravis, GLib  # noqa: E402

GONE_WORDS = (
    "timeout",
    "access",
    "not-connected",
    "not connected",
    "lost",
    "no device",
    "no such device",
)


def gone(why: str) -> DeviceError:
    """The error of a camera that does not answer."""
    return DeviceError(
        "camera-gone",
        f"the camera does not answer ({why})",
        "check its power and cable; one that another program holds does not answer either",
    )


@contextlib.contextmanager
def library() -> Iterator[None]:
    """Errors of the library as ours."""
    try:
        yield
    except GLib.Error as error:
        if any(word in error.message.lower() for word in GONE_WORDS):
            raise gone(error.message) from None
        raise DeviceError(
            "camera-error",
            f"the camera refused: {error.message}",
            "check its settings, or open it again",
        ) from None


class AravisNodes:
    """Features through Aravis."""

    def __init__(self, camera: Any) -> None:  # noqa: ANN401  the library has no types
        self._camera = camera

    def has(self, name: str) -> bool:
        """Whether it is there and can be used now."""
        return bool(self._camera.is_feature_available(name))

    def get(self, name: str) -> features.Value:
        """Its value."""
        node = self._camera.get_device().get_feature(name)
        if isinstance(node, Aravis.GcFloat):
            return float(self._camera.get_float(name))
        if isinstance(node, Aravis.GcEnumeration) or not isinstance(node, Aravis.GcInteger):
            return str(self._camera.get_string(name))
        return int(self._camera.get_integer(name))

    def set(self, name: str, value: features.Value) -> None:
        """Set it."""
        node = self._camera.get_device().get_feature(name)
        if isinstance(node, Aravis.GcBoolean):
            self._camera.set_boolean(name, bool(value))
        elif isinstance(value, str):
            self._camera.set_string(name, value)
        elif isinstance(node, Aravis.GcFloat):
            self._camera.set_float(name, float(value))
        elif isinstance(node, Aravis.GcEnumeration):
            self._camera.set_string(name, "On" if value else "Off")
        else:
            self._camera.set_integer(name, round(value))

    def run(self, name: str) -> None:
        """Execute a command."""
        self._camera.execute_command(name)

    def bounds(self, name: str) -> Optional[tuple[float, float]]:  # noqa: UP045
        """Least and greatest value of a number."""
        bounds = self._camera.get_float_bounds(name)
        return float(bounds.min), float(bounds.max)

    def choices(self, name: str) -> Sequence[str]:
        """Values of an enumeration."""
        return list(self._camera.dup_available_enumerations_as_strings(name))


def pfnc(code: int) -> str:
    """The name of a pixel format by its number."""
    return _PFNC.get(code, f"0x{code:08x}")


_PFNC = {
    getattr(Aravis, constant): name
    for constant, name in {
        "PIXEL_FORMAT_MONO_8": "Mono8",
        "PIXEL_FORMAT_MONO_10": "Mono10",
        "PIXEL_FORMAT_MONO_12": "Mono12",
        "PIXEL_FORMAT_MONO_14": "Mono14",
        "PIXEL_FORMAT_MONO_16": "Mono16",
        "PIXEL_FORMAT_RGB_8_PACKED": "RGB8",
        "PIXEL_FORMAT_BGR_8_PACKED": "BGR8",
        "PIXEL_FORMAT_RGBA_8_PACKED": "RGBa8",
        "PIXEL_FORMAT_BGRA_8_PACKED": "BGRa8",
    }.items()
    if hasattr(Aravis, constant)
}
_PFNC.update(
    {
        getattr(Aravis, f"PIXEL_FORMAT_BAYER_{pattern}_{bits}"): f"Bayer{pattern}{bits}"
        for pattern in ("RG", "GR", "GB", "BG")
        for bits in (8, 10, 12, 16)
        if hasattr(Aravis, f"PIXEL_FORMAT_BAYER_{pattern}_{bits}")
    }
)
_PFNC.update({0x010A0046: "Mono10p", 0x010C0047: "Mono12p"})
