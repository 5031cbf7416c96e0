"""OpenCV's FileStorage YAML. Its conventions are ours: pixel centres at integers, mm kept."""

from __future__ import annotations

import numpy as np

from calibration.adjustment.camera import CalibratedCamera
from calibration.exports.text import numbers, quoted, translation_mm
from geometry.arrays import Floats


def opencv_yaml(cameras: tuple[CalibratedCamera, ...]) -> str:
    """A file for ``cv2.FileStorage``: a list ``cameras`` with K, distortion, R and T each.

    ``x_camera = R X + T`` in millimetres; distortion k1, k2, p1, p2, k3.
    """
    lines = ["%YAML:1.0", "---", f"camera_count: {len(cameras)}", 'length_unit: "mm"', "cameras:"]
    for camera in cameras:
        width, height = camera.image_size_px
        lines += [
            "   -",
            f"      name: {quoted(camera.name)}",
            f"      image_width: {width}",
            f"      image_height: {height}",
        ]
        lines += _matrix("camera_matrix", camera.interior.camera_matrix)
        lines += _matrix("distortion_coefficients", camera.interior.distortion.reshape(1, 5))
        lines += _matrix("R", camera.pose.rotation_rig_to_camera)
        lines += _matrix("T", translation_mm(camera).reshape(3, 1))
    return "\n".join(lines) + "\n"


def _matrix(name: str, matrix: Floats) -> list[str]:
    rows, columns = np.shape(matrix)
    return [
        f"      {name}: !!opencv-matrix",
        f"         rows: {rows}",
        f"         cols: {columns}",
        "         dt: d",
        f"         data: [ {numbers(matrix.ravel())} ]",
    ]
