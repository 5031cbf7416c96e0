"""Depth maps for other programs: a picture of floats for each camera, and what it is of."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from evaluation.reconstruction.depthmaps import DepthMap

SCHEMA = "rigwright.depthmaps/1"


def write_depth_maps(folder: Path, maps: Sequence[DepthMap]) -> None:
    """Writes ``CAMERA.tif`` for each map and ``depthmaps.json`` into a folder that is made.

    A pixel holds the depth along the camera's axis, mm, as a 32-bit float; NaN where nothing was
    measured. The maps are free of distortion and coarser than the pictures: the camera matrix
    that stands beside each is that of the map.
    """
    folder.mkdir()
    cameras = []
    for map_ in maps:
        view = map_.reference
        depth = (1.0 / map_.inverse_depth_per_mm).astype(np.float32)
        Image.fromarray(depth).save(folder / f"{view.name}.tif", compression="tiff_deflate")
        # Pixel centres at integers in both: every stride-th pixel of the picture.
        small = np.diag([1.0 / map_.stride_px, 1.0 / map_.stride_px, 1.0]) @ view.matrix
        cameras.append(
            {
                "name": view.name,
                "file": f"{view.name}.tif",
                "camera_matrix": small.tolist(),
                "position_mm": view.pose.position_rig_mm.tolist(),
                "rotation_rig_to_camera": view.pose.rotation_rig_to_camera.tolist(),
            }
        )
    document = {"schema": SCHEMA, "cameras": cameras}
    (folder / "depthmaps.json").write_text(json.dumps(document, indent=1), encoding="utf-8")
