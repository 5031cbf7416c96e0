"""Live pictures of simulated cameras: of few, large pixels, so that they are quick to render."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace

from common.errors import DeviceError
from geometry.camera import RigCamera
from rig.acquisition.cameras.base import Image

PREVIEW_PX = 320
"""A live picture's shorter side is at least so long where the camera's is."""

_LOOK_S = 0.01


def preview_camera(rig_camera: RigCamera) -> RigCamera:
    """The camera with larger pixels; a rest of them at the right and below is cut off."""
    camera = rig_camera.camera
    times = max(1, min(camera.image_size_px) // PREVIEW_PX)
    larger = replace(
        camera,
        image_size_px=(camera.image_size_px[0] // times, camera.image_size_px[1] // times),
        pixel_pitch_mm=camera.pixel_pitch_mm * times,
        # Centres of pixels are at integers: the first large one is amid the first few.
        principal_point_px=(camera.principal_point_px + 0.5) / times - 0.5,
    )
    return replace(rig_camera, camera=larger)


def awaited(picture: Future[Image], over: Callable[[], bool]) -> Image | None:
    """The picture, None once it is ``over``. Raises :class:`DeviceError` when there is none."""
    while not wait([picture], _LOOK_S).done:
        if over():
            picture.cancel()
            return None
    try:
        return picture.result()
    except (BrokenProcessPool, CancelledError) as error:
        raise DeviceError(
            "camera-error",
            f"a live picture was not rendered ({type(error).__name__})",
            "open the rig again, with fewer workers if memory is short",
        ) from error
