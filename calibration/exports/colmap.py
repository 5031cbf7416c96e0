"""COLMAP's text model with a rig: rigs, cameras, frames, images, points3D (version 3.12 on).

COLMAP puts the centre of the first pixel at (0.5, 0.5); everything else is as OpenCV has it.
"""

from __future__ import annotations

from scipy.spatial.transform import Rotation

from calibration.adjustment.camera import CalibratedCamera
from calibration.exports.text import numbers, translation_mm
from geometry.arrays import Floats
from geometry.errors import InputError

HALF_PIXEL = 0.5


def colmap_files(
    cameras: tuple[CalibratedCamera, ...], image_names: tuple[str, ...] | None = None
) -> dict[str, str]:
    """The five text files by name. One frame, whose rig has the first camera as its reference.

    ``image_names`` of that frame, in the cameras' order; ``NAME.png`` without them. Lengths stay
    in millimetres: COLMAP has no unit.
    """
    names = image_names or tuple(f"{c.name}.png" for c in cameras)
    if len(names) != len(cameras) or any(set(n) & {" ", "\t", "\n"} for n in names):
        raise InputError(
            "export-names",
            "COLMAP needs one image name without spaces for each camera",
            "give image_names for the cameras in their order",
        )
    return {
        "cameras.txt": _cameras(cameras),
        "rigs.txt": _rigs(cameras),
        "frames.txt": _frames(cameras),
        "images.txt": _images(cameras, names),
        "points3D.txt": "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[]\n",
    }


def _cameras(cameras: tuple[CalibratedCamera, ...]) -> str:
    lines = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    for k, camera in enumerate(cameras, 1):
        matrix, (k1, k2, p1, p2, k3) = camera.interior.camera_matrix, camera.interior.distortion
        width, height = camera.image_size_px
        values = [matrix[0, 0], matrix[1, 1], matrix[0, 2] + HALF_PIXEL, matrix[1, 2] + HALF_PIXEL]
        values += [k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]
        lines.append(f"{k} FULL_OPENCV {width} {height} {numbers(values, ' ')}")
    return "\n".join(lines) + "\n"


def _pose(rotation: Floats, shift: Floats) -> str:
    x, y, z, w = Rotation.from_matrix(rotation).as_quat(canonical=True)
    return numbers([w, x, y, z, *shift], " ")


def _rigs(cameras: tuple[CalibratedCamera, ...]) -> str:
    first = cameras[0].pose.rotation_rig_to_camera, translation_mm(cameras[0])
    parts = [f"1 {len(cameras)} CAMERA 1"]
    for k, camera in enumerate(cameras[1:], 2):
        turn = camera.pose.rotation_rig_to_camera @ first[0].T
        shift = translation_mm(camera) - turn @ first[1]
        parts.append(f"CAMERA {k} 1 {_pose(turn, shift)}")
    head = (
        "# RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, SENSORS[] as "
        "(SENSOR_TYPE, SENSOR_ID, HAS_POSE, [QW, QX, QY, QZ, TX, TY, TZ])"
    )
    return f"{head}\n{' '.join(parts)}\n"


def _frames(cameras: tuple[CalibratedCamera, ...]) -> str:
    first = cameras[0]
    pose = _pose(first.pose.rotation_rig_to_camera, translation_mm(first))
    data = " ".join(f"CAMERA {k} {k}" for k in range(1, len(cameras) + 1))
    head = (
        "# FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, TZ], NUM_DATA_IDS, "
        "DATA_IDS[] as (SENSOR_TYPE, SENSOR_ID, DATA_ID)"
    )
    return f"{head}\n1 1 {pose} {len(cameras)} {data}\n"


def _images(cameras: tuple[CalibratedCamera, ...], names: tuple[str, ...]) -> str:
    lines = ["# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME; then POINTS2D[] of it"]
    for k, (camera, name) in enumerate(zip(cameras, names, strict=True), 1):
        pose = _pose(camera.pose.rotation_rig_to_camera, translation_mm(camera))
        lines += [f"{k} {pose} {k} {name}", ""]
    return "\n".join(lines) + "\n"
