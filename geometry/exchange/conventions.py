"""Conversions between Rigwright's conventions and those of other programs.

Rigwright: millimetres, camera axes x right, y down, z forward, ``x_camera = R (X - C)``, pixel
centres at integers. ``docs/how-to/exports.md`` lists what each program expects; every difference is
one of the functions here.
"""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats
from geometry.camera import TERM_NAMES, Camera
from geometry.frames import PHOTO_TO_CV, Pose

METRES_PER_MM = 1e-3
CENTIMETRES_PER_MM = 1e-1

GLTF_FROM_RIG_AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Turns the rig frame (Z up) to glTF's world (Y up, the face along +Z)."""


def number(value: float) -> str:
    """The shortest decimal that reads back as ``value``, and never ``-0.0``."""
    return repr(float(value) + 0.0)


def numbers(values: Floats) -> str:
    """All of ``values`` in row-major order, separated by blanks."""
    return " ".join(number(v) for v in np.asarray(values).ravel())


def number_lists(values: Floats) -> str:
    """A vector or matrix as (nested) lists, as JSON, TOML and YAML have them."""
    if values.ndim > 1:
        return "[" + ", ".join(number_lists(row) for row in values) + "]"
    return "[" + ", ".join(number(v) for v in values) + "]"


def quaternion_wxyz(rotation: Floats) -> Floats:
    """Unit quaternion w, x, y, z (Hamilton) of a rotation (3, 3), (4,); w is not negative."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat(canonical=True)
    return np.array([w, x, y, z])


def translation_mm(pose: Pose) -> Floats:
    """``T`` of ``x_camera = R X + T``, (3,)."""
    return np.asarray(-pose.rotation_rig_to_camera @ pose.position_rig_mm)


def distortion_key(camera: Camera) -> str:
    """The name under which programs without lens distortion keep it, with its terms in order."""
    return "_".join(["distortion", *TERM_NAMES[camera.lens_model]])


def corner_principal_point_px(camera: Camera) -> Floats:
    """Principal point with the image's corner at (0, 0), (2,): the first pixel's centre is 0.5."""
    return np.asarray(camera.principal_point_px + 0.5)


def principal_offset_px(camera: Camera) -> Floats:
    """From the middle of the image to the principal point, right and down, (2,)."""
    width, height = camera.image_size_px
    return np.asarray(corner_principal_point_px(camera) - np.array([width / 2.0, height / 2.0]))


def camera_to_rig(pose: Pose, units_per_mm: float) -> Floats:
    """Matrix (4, 4) from the camera's axes (OpenCV) to the rig frame, in the units asked for."""
    matrix = np.eye(4)
    matrix[:3, :3] = pose.rotation_rig_to_camera.T
    matrix[:3, 3] = pose.position_rig_mm * units_per_mm
    return matrix


def graphics_camera_to_rig(pose: Pose, units_per_mm: float) -> Floats:
    """The same for a camera that looks along its -z axis with y up (OpenGL), (4, 4)."""
    matrix = camera_to_rig(pose, units_per_mm)
    matrix[:3, :3] = matrix[:3, :3] @ PHOTO_TO_CV
    return matrix


def yaw_pitch_roll_deg(pose: Pose) -> Floats:
    """Yaw, pitch and roll as survey programs have them, (3,).

    The camera's axes x right, y up, z backward are ``Rz(-yaw) Rx(pitch) Ry(roll)`` of the
    world's (east, north, up): all zero looks straight down with north at the top, yaw turns
    clockwise as seen from above, pitch 90 looks at the horizon. At the horizon yaw and roll
    turn about one axis; roll is then 0.
    """
    m = graphics_camera_to_rig(pose, 1.0)[:3, :3]
    level = np.hypot(m[2, 0], m[2, 2])
    pitch = np.arctan2(m[2, 1], level)
    if level < 1e-12:
        roll, yaw = 0.0, np.arctan2(-m[1, 0], m[0, 0])
    else:
        roll = np.arctan2(-m[2, 0], m[2, 2])
        yaw = np.arctan2(m[0, 1], m[1, 1])
    return np.asarray(np.degrees([yaw, pitch, roll]))
