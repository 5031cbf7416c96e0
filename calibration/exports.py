"""Calibrated cameras for other programs: as the rig's cameras, which ``geometry.exchange`` writes.

``export_files("colmap-text", rig_cameras(calibration.cameras))``; ``docs/how-to/exports.md`` lists
the formats.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibration.adjustment.camera import CalibratedCamera
from common.errors import InputError
from geometry.camera import Body, Camera, RigCamera

FULL_FRAME_MM = 36.0
"""Width of the sensor that is written where nobody says how large it is: pixels alone count."""

NOMINAL_F_NUMBER = 8.0
NOMINAL_BODY_MM = 100.0


def rig_cameras(
    cameras: tuple[CalibratedCamera, ...], like: tuple[RigCamera, ...] = ()
) -> tuple[RigCamera, ...]:
    """Calibrated cameras as cameras of a rig, in their order.

    ``like``: cameras, such as the design's, that tell pixel pitch, body and focus of those of the
    same name. Without, sensors are written as 36 mm wide. Raises :class:`InputError` for an
    affinity: pixels of a rig's cameras are square.
    """
    known = {camera.name: camera for camera in like}
    return tuple(_rig_camera(camera, known.get(camera.name)) for camera in cameras)


def _rig_camera(camera: CalibratedCamera, like: RigCamera | None) -> RigCamera:
    if camera.interior.affinity != 0.0:
        raise InputError(
            "export-affinity",
            f"camera {camera.name!r} has pixels that are not square (b1)",
            "calibrate with b1 fixed at 0 for exports",
        )
    kind = like.camera if like is not None else _nominal(camera)
    if kind.image_size_px != camera.image_size_px:
        raise InputError(
            "export-image-size",
            f"camera {camera.name!r} has images of another size than the one it is likened to",
            "give the design that was calibrated",
        )
    calibrated = replace(
        kind,
        focal_length_mm=camera.interior.focal_length_px * kind.pixel_pitch_mm,
        principal_point_px=camera.interior.principal_point_px,
        distortion=camera.interior.distortion,
    )
    if like is not None:
        return replace(like, camera=calibrated, pose=camera.pose)
    focus_mm = max(kind.min_focus_distance_mm, float(np.linalg.norm(camera.pose.position_rig_mm)))
    return RigCamera(camera.name, calibrated, camera.pose, focus_mm)


def _nominal(camera: CalibratedCamera) -> Camera:
    """A camera of which nothing but its images is known."""
    pitch_mm = FULL_FRAME_MM / camera.image_size_px[0]
    focal_mm = camera.interior.focal_length_px * pitch_mm
    return Camera(
        "calibrated",
        camera.image_size_px,
        pitch_mm,
        focal_mm,
        NOMINAL_F_NUMBER,
        pitch_mm,
        2.0 * focal_mm,
        Body(np.full(3, NOMINAL_BODY_MM), np.array([0.0, 0.0, -NOMINAL_BODY_MM])),
    )
