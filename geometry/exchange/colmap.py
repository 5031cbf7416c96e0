"""COLMAP models, text and binary, with the rig as one rig and one frame.

The layout is that of COLMAP 3.12 and later: ``rigs`` holds each sensor's pose in the rig,
``frames`` the rig's pose in the world, ``images`` the same poses for readers that know no rigs.
The rig's frame is that of its first camera. World to camera, quaternions w x y z, metres; the
corner of the image is (0, 0).
"""

from __future__ import annotations

import struct
from collections.abc import Iterable

import numpy as np

from geometry.arrays import Floats
from geometry.camera import Camera, LensModel
from geometry.exchange.base import Cameras, ExportOptions, Files, Format, image_name
from geometry.exchange.conventions import (
    METRES_PER_MM,
    corner_principal_point_px,
    numbers,
    quaternion_wxyz,
    translation_mm,
)
from geometry.frames import Pose

MODEL_NUMBERS = {"PINHOLE": 1, "OPENCV": 4, "OPENCV_FISHEYE": 5, "FULL_OPENCV": 6}
CAMERA_SENSOR = 0
RIG_ID = FRAME_ID = 1


def lens_model(camera: Camera) -> tuple[str, Floats]:
    """COLMAP's smallest model that holds the camera's distortion, and its parameters."""
    f, (cx, cy) = camera.focal_length_px, corner_principal_point_px(camera)
    pinhole = [f, f, cx, cy]
    if camera.lens_model is LensModel.FISHEYE:
        return "OPENCV_FISHEYE", np.array([*pinhole, *camera.distortion])
    if camera.lens_model is LensModel.RATIONAL:
        return "FULL_OPENCV", np.array([*pinhole, *camera.distortion])
    k1, k2, p1, p2, k3 = camera.distortion
    if not camera.distortion.any():
        return "PINHOLE", np.array(pinhole)
    if k3 == 0.0:
        return "OPENCV", np.array([*pinhole, k1, k2, p1, p2])
    return "FULL_OPENCV", np.array([*pinhole, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0])


def _rigid(rotation: Floats, translation: Floats) -> Floats:
    """qw, qx, qy, qz, tx, ty, tz, (7,), metres."""
    return np.concatenate([quaternion_wxyz(rotation), translation * METRES_PER_MM])


def _from_world(pose: Pose) -> Floats:
    return _rigid(pose.rotation_rig_to_camera, translation_mm(pose))


def _sensor_from_rig(pose: Pose, reference: Pose) -> Floats:
    rotation = pose.rotation_rig_to_camera @ reference.rotation_rig_to_camera.T
    between = reference.position_rig_mm - pose.position_rig_mm
    return _rigid(rotation, pose.rotation_rig_to_camera @ between)


def _text(lines: Iterable[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()


def write_text(cameras: Cameras, options: ExportOptions) -> Files:
    """The five text files."""
    sensors, images, sights = [], [], []
    for index, camera in enumerate(cameras, 1):
        width, height = camera.camera.image_size_px
        model, parameters = lens_model(camera.camera)
        sensors.append(f"{index} {model} {width} {height} {numbers(parameters)}")
        name = image_name(camera, options)
        # An image's second line lists its points: none are known, so it is empty.
        images += [f"{index} {numbers(_from_world(camera.pose))} {index} {name}", ""]
        sights.append(f"CAMERA {index} {index}")
    rig = [f"{RIG_ID} {len(cameras)} CAMERA 1"]
    for index, camera in enumerate(cameras[1:], 2):
        pose = _sensor_from_rig(camera.pose, cameras[0].pose)
        rig.append(f"CAMERA {index} 1 {numbers(pose)}")
    place = numbers(_from_world(cameras[0].pose))
    frame = f"{FRAME_ID} {RIG_ID} {place} {len(cameras)} {' '.join(sights)}"
    return {
        "cameras.txt": _text(["# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]", *sensors]),
        "rigs.txt": _text(["# RIG_ID NUM_SENSORS REF_SENSOR SENSORS[]", " ".join(rig)]),
        "frames.txt": _text(["# FRAME_ID RIG_ID RIG_FROM_WORLD NUM_DATA DATA[]", frame]),
        "images.txt": _text(
            ["# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, POINTS2D[]", *images]
        ),
        "points3D.txt": _text(["# POINT3D_ID X Y Z R G B ERROR TRACK[]"]),
    }


def _doubles(values: Floats) -> bytes:
    return np.asarray(values, dtype="<f8").tobytes()


def write_binary(cameras: Cameras, options: ExportOptions) -> Files:
    """The five binary files, little-endian."""
    count = struct.pack("<Q", len(cameras))
    sensors, images = [count], [count]
    rig = [struct.pack("<QIIiI", 1, RIG_ID, len(cameras), CAMERA_SENSOR, 1)]
    place = _doubles(_from_world(cameras[0].pose))
    frame = [struct.pack("<QII", 1, FRAME_ID, RIG_ID), place, struct.pack("<I", len(cameras))]
    for index, camera in enumerate(cameras, 1):
        model, parameters = lens_model(camera.camera)
        head = struct.pack("<IiQQ", index, MODEL_NUMBERS[model], *camera.camera.image_size_px)
        sensors += [head, _doubles(parameters)]
        name = image_name(camera, options).encode() + b"\0"
        pose = _doubles(_from_world(camera.pose))
        images += [struct.pack("<I", index), pose, struct.pack("<I", index), name]
        images.append(struct.pack("<Q", 0))
        frame.append(struct.pack("<iIQ", CAMERA_SENSOR, index, index))
        if index > 1:
            relative = _sensor_from_rig(camera.pose, cameras[0].pose)
            rig += [struct.pack("<iIB", CAMERA_SENSOR, index, 1), _doubles(relative)]
    return {
        "cameras.bin": b"".join(sensors),
        "rigs.bin": b"".join(rig),
        "frames.bin": b"".join(frame),
        "images.bin": b"".join(images),
        "points3D.bin": struct.pack("<Q", 0),
    }


_PARTS = ("cameras", "rigs", "frames", "images", "points3D")

TEXT = Format(
    "colmap-text",
    "COLMAP 3.12 or later",
    "a sparse model with rig and frame as text",
    tuple(f"{part}.txt" for part in _PARTS),
    write_text,
    tuple(LensModel),
)
BINARY = Format(
    "colmap-binary",
    "COLMAP 3.12 or later",
    "the same in COLMAP's binary form",
    tuple(f"{part}.bin" for part in _PARTS),
    write_binary,
    tuple(LensModel),
)
