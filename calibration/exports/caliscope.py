"""A camera array in the style of caliscope's TOML: OpenCV's conventions, metres."""

from __future__ import annotations

from calibration.adjustment.camera import CalibratedCamera
from calibration.exports.text import METRE, matrix_rows, numbers, translation_mm


def caliscope_toml(cameras: tuple[CalibratedCamera, ...], rms_px: tuple[float, ...] = ()) -> str:
    """``camera_array.toml``: one table for each camera, numbered from 0 in their order.

    ``rms_px`` of each camera's residuals stands as its ``error``, 0 without them.
    """
    errors = rms_px or (0.0,) * len(cameras)
    parts = []
    for k, (camera, error) in enumerate(zip(cameras, errors, strict=True)):
        lines = [
            f"[cameras.{k}]",
            f"cam_id = {k}",
            f"size = [{camera.image_size_px[0]}, {camera.image_size_px[1]}]",
            "rotation_count = 0",
            f"error = {float(error)!r}",
            f"matrix = {matrix_rows(camera.interior.camera_matrix)}",
            f"distortions = [{numbers(camera.interior.distortion)}]",
            f"translation = [{numbers(METRE * translation_mm(camera))}]",
            f"rotation = {matrix_rows(camera.pose.rotation_rig_to_camera)}",
            "ignore = false",
        ]
        parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)
