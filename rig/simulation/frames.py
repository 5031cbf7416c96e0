"""Frames of simulated cameras on their way to the host, and the settings they are taken with."""

from __future__ import annotations

from concurrent.futures import CancelledError, Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace

from common.errors import DeviceError, InputError
from rig.acquisition.cameras.base import CameraSettings, Frame, FrameStatus, Image
from rig.simulation.settings import PIXEL_FORMATS

SETTABLE = frozenset({"exposure_us", "gain_db", "f_number", "pixel_format"})
_LIMITS = {"exposure_us": (1.0, 1e7), "gain_db": (0.0, 48.0), "f_number": (0.7, 64.0)}


def settled(camera_id: str, present: CameraSettings, wanted: CameraSettings) -> CameraSettings:
    """The settings a camera has once ``wanted`` was asked of it.

    Exposures are of whole microseconds, gain of tenths of a decibel. Raises
    :class:`InputError` ``camera-setting`` for what it cannot have.
    """
    given = {name: getattr(wanted, name) for name in SETTABLE}
    given = {name: value for name, value in given.items() if value is not None}
    for name, value in given.items():
        if name == "pixel_format":
            possible, good = ", ".join(PIXEL_FORMATS), value in PIXEL_FORMATS
        else:
            low, high = _LIMITS[name]
            possible, good = f"{low:g} to {high:g}", low <= value <= high
        if not good:
            problem = f"camera {camera_id} cannot have {name} {value}"
            raise InputError("camera-setting", problem, f"give {possible}")
    if "exposure_us" in given:
        given["exposure_us"] = float(max(1, round(given["exposure_us"])))
    if "gain_db" in given:
        given["gain_db"] = round(given["gain_db"], 1)
    return replace(present, **given)


@dataclass(frozen=True, eq=False)
class Coming:
    """A frame without its pixels, and the picture that is being rendered for it.

    ``faults`` are those that change the picture; ``late`` frames arrive after their deadline,
    ``triggered`` ones were asked for.
    """

    frame: Frame
    picture: Future[Image]
    faults: frozenset[str]
    late: bool
    triggered: bool

    @property
    def arrives_ns(self) -> int:
        """When it arrives, on the host's clock."""
        return self.frame.arrived_host_ns

    def rendered(self, limit_s: float | None) -> Image:
        """The picture. Raises :class:`DeviceError` when it cannot be had."""
        try:
            return self.picture.result(timeout=limit_s)
        except TimeoutError as error:
            raise DeviceError(
                "camera-gone",
                f"the picture of simulated camera {self.frame.camera_id} was not rendered within "
                f"{limit_s:g} s",
                "raise render_limit_s in [simulation], or leave it out",
            ) from error
        except (BrokenProcessPool, CancelledError) as error:
            raise DeviceError(
                "camera-gone",
                f"the picture of simulated camera {self.frame.camera_id} was not rendered "
                f"({type(error).__name__})",
                "start again, with fewer workers if memory is short",
            ) from error

    def developed(self, limit_s: float | None) -> Frame:
        """The frame with its picture, and with what happened to it on its way."""
        pixels, status = self.rendered(limit_s), self.frame.status
        height, width = pixels.shape[:2]
        if "wrong_size" in self.faults:
            pixels = pixels[: height // 2, : width // 2].copy()
        if "incomplete" in self.faults:
            pixels = pixels.copy()
            pixels[2 * len(pixels) // 3 :] = 0
            status = FrameStatus.INCOMPLETE
        return replace(self.frame, pixels=pixels, status=status)
