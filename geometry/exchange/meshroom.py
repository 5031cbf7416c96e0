"""Meshroom and AliceVision: ``cameras.sfm``.

``rotation`` lists the world-to-camera matrix column by column and ``center`` is the projection
centre, in metres. The principal point counts from (width / 2, height / 2) with pixel centres at
integers; the focal length is in millimetres of a sensor whose width is given. All values are
strings, as the program writes them.
"""

from __future__ import annotations

import json

from geometry.arrays import Floats
from geometry.camera import Camera, RigCamera
from geometry.exchange.base import Cameras, ExportOptions, Files, Format, image_name
from geometry.exchange.conventions import METRES_PER_MM, number

VERSION = ("1", "2", "5")


def _strings(values: Floats) -> list[str]:
    return [number(v) for v in values]


def _intrinsic(index: int, serial: str, camera: Camera) -> dict[str, object]:
    width, height = camera.image_size_px
    k1, k2, p1, p2, k3 = camera.distortion
    sensor_width_mm, sensor_height_mm = camera.sensor_size_mm
    cx, cy = camera.principal_point_px
    distorted = bool(camera.distortion.any())
    terms = [k1, k2, k3, p1, p2] if distorted else []
    return {
        "intrinsicId": str(index),
        "width": str(width),
        "height": str(height),
        "sensorWidth": number(sensor_width_mm),
        "sensorHeight": number(sensor_height_mm),
        "serialNumber": serial,
        "type": "brown" if distorted else "pinhole",
        "initializationMode": "calibrated",
        "initialFocalLength": number(camera.focal_length_mm),
        "focalLength": number(camera.focal_length_mm),
        "pixelRatio": "1",
        "pixelRatioLocked": "true",
        "principalPoint": [number(cx - width / 2.0), number(cy - height / 2.0)],
        "distortionInitializationMode": "calibrated",
        "distortionParams": [number(v) for v in terms],
        "undistortionOffset": ["0", "0"],
        "undistortionParams": [],
        "locked": "false",
    }


def _view(index: int, camera: RigCamera, options: ExportOptions) -> dict[str, object]:
    width, height = camera.camera.image_size_px
    return {
        "viewId": str(index),
        "poseId": str(index),
        "intrinsicId": str(index),
        "path": image_name(camera, options),
        "width": str(width),
        "height": str(height),
        "metadata": {},
    }


def _pose(index: int, camera: RigCamera) -> dict[str, object]:
    pose = camera.pose
    transform = {
        "rotation": _strings(pose.rotation_rig_to_camera.T.ravel()),
        "center": _strings(pose.position_rig_mm * METRES_PER_MM),
    }
    return {"poseId": str(index), "pose": {"transform": transform, "locked": "0"}}


def write(cameras: Cameras, options: ExportOptions) -> Files:
    """``cameras.sfm``."""
    numbered = list(enumerate(cameras, 1))
    document = {
        "version": list(VERSION),
        "views": [_view(index, camera, options) for index, camera in numbered],
        "intrinsics": [_intrinsic(index, camera.name, camera.camera) for index, camera in numbered],
        "poses": [_pose(index, camera) for index, camera in numbered],
    }
    return {"cameras.sfm": (json.dumps(document, indent=1) + "\n").encode()}


FORMAT = Format(
    "meshroom",
    "Meshroom, AliceVision",
    "views, intrinsics and poses for the SfM input of a pipeline",
    ("cameras.sfm",),
    write,
)
