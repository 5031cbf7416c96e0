"""Depth maps as files: what another program makes of them is the surface."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import matching_scenes as scenes
import numpy as np
from PIL import Image

from evaluation.reconstruction.depthfile import write_depth_maps
from evaluation.reconstruction.depthmaps import DepthMap


def test_pixels_and_their_cameras_make_the_surface(tmp_path: Path) -> None:
    view = replace(scenes.plane_views()[1], name="left")
    rho = scenes.true_inverse_depth(view)[::3, ::3].copy()
    rho[:4] = np.nan
    empty = np.zeros(rho.shape)
    map_ = DepthMap(
        view, 3, rho, np.zeros((*rho.shape, 2)), empty, empty.astype(np.float32),
        empty.astype(np.int8),
    )  # fmt: skip
    write_depth_maps(tmp_path / "depthmaps", [map_])
    told = json.loads((tmp_path / "depthmaps" / "depthmaps.json").read_text())
    (camera,) = told["cameras"]
    assert camera["name"] == "left"
    depth = np.asarray(Image.open(tmp_path / "depthmaps" / camera["file"]), dtype=np.float64)
    assert np.array_equal(np.isnan(depth), np.isnan(rho))
    rows, columns = np.nonzero(np.isfinite(depth))
    pixel = np.column_stack([columns, rows, np.ones(len(rows))])
    rays = pixel @ np.linalg.inv(np.array(camera["camera_matrix"])).T
    local = rays * depth[rows, columns][:, None]
    points = local @ np.array(camera["rotation_rig_to_camera"]) + np.array(camera["position_mm"])
    # 32 bits keep 420 mm to 3e-5 mm; the ray is as long again at most.
    assert np.abs(points @ scenes.TILTED).max() < 1e-4
