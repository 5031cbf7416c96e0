"""Blender itself builds the cameras and says where points fall in its images."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from exchange_rigs import many_cameras, points_in_view

from geometry.exchange import write_export

BLENDER_PYTHON = os.environ.get("TESTS_BLENDER_PYTHON")

PROBE = """
import json, runpy, sys
import bpy
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

how, path, points, out = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
if how == "script":
    runpy.run_path(path)
else:
    bpy.ops.import_scene.gltf(filepath=path)
bpy.context.view_layer.update()
scene = bpy.context.scene
found = {}
for holder in [o for o in bpy.data.objects if o.type == "CAMERA"]:
    data = holder.data
    size = data.get("image_size_px") or holder["image_size_px"]
    scene.render.resolution_x, scene.render.resolution_y = list(size)
    views = [world_to_camera_view(scene, holder, Vector(p)) for p in json.loads(points)]
    name = holder.name if how == "script" else data.name
    found[name] = [[v.x * size[0], (1.0 - v.y) * size[1]] for v in views]
json.dump(found, open(out, "w"))
"""


def blender_pixels(how: str, path: Path, tmp_path: Path) -> dict[str, np.ndarray]:
    """Pixels with the corner at (0, 0) of the points in each camera."""
    probe, out = tmp_path / "probe.py", tmp_path / "found.json"
    probe.write_text(PROBE)
    points = json.dumps((points_in_view() / 1000.0).tolist())
    subprocess.run(
        [str(BLENDER_PYTHON), str(probe), how, str(path), points, str(out)],
        check=True,
        capture_output=True,
        timeout=120,
    )
    return {name: np.array(pixels) for name, pixels in json.loads(out.read_text()).items()}


@pytest.mark.skipif(BLENDER_PYTHON is None, reason="TESTS_BLENDER_PYTHON names no interpreter")
def test_blender_builds_cameras_that_see_as_ours(tmp_path: Path) -> None:
    cameras = many_cameras(False)
    path = write_export(tmp_path / "out", "blender", cameras)["cameras_blender.py"]
    found = blender_pixels("script", path, tmp_path)
    assert set(found) == {camera.name for camera in cameras}
    for camera in cameras:
        pixels, _ = camera.camera.project(camera.pose, points_in_view())
        # 32-bit matrices: 4000 px x 6e-8 per operation.
        assert np.abs(found[camera.name] - 0.5 - pixels).max() < 5e-3


@pytest.mark.skipif(BLENDER_PYTHON is None, reason="TESTS_BLENDER_PYTHON names no interpreter")
def test_blender_imports_the_glb_with_its_cameras(tmp_path: Path) -> None:
    cameras = many_cameras(False)
    path = write_export(tmp_path / "out", "gltf", cameras)["cameras.glb"]
    found = blender_pixels("gltf", path, tmp_path)
    assert set(found) == {camera.name for camera in cameras}
    for camera in cameras:
        pixels, _ = camera.camera.project(camera.pose, points_in_view())
        # glTF knows no principal point: the view's middle stands for it.
        middle = np.array(camera.camera.image_size_px) / 2.0
        expected = pixels - camera.camera.principal_point_px + middle
        assert np.abs(found[camera.name] - expected).max() < 5e-3
