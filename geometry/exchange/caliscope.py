"""caliscope and tools like it: a camera array as TOML.

World to camera, ``x_camera = R X + T``, metres, pixel centres at integers.
"""

from __future__ import annotations

import json

import numpy as np

from geometry.camera import LensModel
from geometry.exchange.base import Cameras, ExportOptions, Files, Format
from geometry.exchange.conventions import METRES_PER_MM, number_lists, translation_mm


def write(cameras: Cameras, _options: ExportOptions) -> Files:
    """``camera_array.toml``: one table for each camera, numbered from 0 in their order."""
    tables = []
    for index, one in enumerate(cameras):
        kind, pose = one.camera, one.pose
        lines = [
            f"[cameras.{index}]",
            f"cam_id = {index}",
            # JSON's quotes and escapes are TOML's.
            f"name = {json.dumps(one.name, ensure_ascii=False)}",
            f"size = [{kind.image_size_px[0]}, {kind.image_size_px[1]}]",
            "rotation_count = 0",
            f"matrix = {number_lists(kind.camera_matrix)}",
            f"distortions = {number_lists(kind.distortion)}",
            f"translation = {number_lists(translation_mm(pose) * METRES_PER_MM)}",
            f"rotation = {number_lists(np.asarray(pose.rotation_rig_to_camera))}",
            "ignore = false",
        ]
        if kind.lens_model is LensModel.FISHEYE:
            lines.append("fisheye = true")
        tables.append("\n".join(lines) + "\n")
    return {"camera_array.toml": "\n".join(tables).encode()}


FORMAT = Format(
    "caliscope",
    "caliscope",
    "a camera array as TOML",
    ("camera_array.toml",),
    write,
    (LensModel.BROWN, LensModel.FISHEYE),
)
