"""OpenCV: a YAML file for ``cv2.FileStorage``.

World to camera, ``x_camera = R X + T``, millimetres, pixel centres at integers: Rigwright's own
conventions.
"""

from __future__ import annotations

import json

import numpy as np

from geometry.arrays import Floats
from geometry.camera import LensModel, RigCamera
from geometry.exchange.base import Cameras, ExportOptions, Files, Format, image_name
from geometry.exchange.conventions import number, translation_mm


def _matrix(key: str, values: Floats) -> list[str]:
    rows, columns = values.shape
    data = ", ".join(number(v) for v in values.ravel())
    return [
        f"      {key}: !!opencv-matrix",
        f"         rows: {rows}",
        f"         cols: {columns}",
        "         dt: d",
        f"         data: [ {data} ]",
    ]


def _camera(rig_camera: RigCamera, options: ExportOptions) -> list[str]:
    camera, pose = rig_camera.camera, rig_camera.pose
    # JSON's quotes are YAML's: a name like "no" or "1e3" must stay a string.
    return [
        "   -",
        f"      name: {json.dumps(rig_camera.name, ensure_ascii=False)}",
        f"      image: {json.dumps(image_name(rig_camera, options), ensure_ascii=False)}",
        f"      image_width: {camera.image_size_px[0]}",
        f"      image_height: {camera.image_size_px[1]}",
        *_model(camera.lens_model),
        *_matrix("camera_matrix", camera.camera_matrix),
        *_matrix("distortion_coefficients", camera.distortion[None, :]),
        *_matrix("rotation", np.asarray(pose.rotation_rig_to_camera)),
        *_matrix("translation_mm", translation_mm(pose)[:, None]),
    ]


def _model(lens: LensModel) -> list[str]:
    """Said of a fisheye only: ``cv2.fisheye`` takes its four terms, all else the others."""
    return ["      model: fisheye"] if lens is LensModel.FISHEYE else []


def write(cameras: Cameras, options: ExportOptions) -> Files:
    """``cameras.yml``."""
    lines = ["%YAML:1.0", "---", "cameras:"]
    for camera in cameras:
        lines += _camera(camera, options)
    return {"cameras.yml": ("\n".join(lines) + "\n").encode()}


FORMAT = Format(
    "opencv",
    "OpenCV",
    "camera matrices, distortion, rotations and translations for FileStorage",
    ("cameras.yml",),
    write,
    tuple(LensModel),
)
