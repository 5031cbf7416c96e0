"""A Python script that builds the cameras inside Blender.

Blender: metres, Z up, cameras look along -z with y up; focal length and sensor width in
millimetres, the principal point as a shift in image widths. Lens distortion is kept as a custom
property: Blender's cameras have none.
"""

from __future__ import annotations

import json

from geometry.camera import LensModel, RigCamera
from geometry.exchange.base import Cameras, ExportOptions, Files, Format, image_name
from geometry.exchange.conventions import (
    METRES_PER_MM,
    distortion_key,
    graphics_camera_to_rig,
    principal_offset_px,
)

_SCRIPT = '''\
"""Builds the cameras of a rig. Run it in Blender's text editor, or: blender --python FILE"""

import json

import bpy
from mathutils import Matrix

CAMERAS = json.loads(r"""
{cameras}
""")

collection = bpy.data.collections.new("Rig")
bpy.context.scene.collection.children.link(collection)
for given in CAMERAS:
    camera = bpy.data.cameras.new(given["name"])
    camera.sensor_fit = "HORIZONTAL"
    camera.sensor_width = given["sensor_width_mm"]
    camera.sensor_height = given["sensor_height_mm"]
    camera.lens = given["focal_length_mm"]
    camera.shift_x = given["shift_x"]
    camera.shift_y = given["shift_y"]
    camera.dof.focus_distance = given["focus_distance_m"]
    camera.dof.aperture_fstop = given["f_number"]
    camera["image"] = given["image"]
    camera["image_size_px"] = given["image_size_px"]
    for key in given:
        if key.startswith("distortion_"):
            camera[key] = given[key]
    holder = bpy.data.objects.new(given["name"], camera)
    holder.matrix_world = Matrix(given["matrix_world"])
    collection.objects.link(holder)

render = bpy.context.scene.render
render.resolution_x, render.resolution_y = CAMERAS[0]["image_size_px"]
render.resolution_percentage = 100
render.pixel_aspect_x = render.pixel_aspect_y = 1.0
bpy.context.scene.camera = bpy.data.objects[CAMERAS[0]["name"]]
'''


def _camera(rig_camera: RigCamera, options: ExportOptions) -> dict[str, object]:
    camera = rig_camera.camera
    width = camera.image_size_px[0]
    right, down = principal_offset_px(camera)
    return {
        "name": rig_camera.name,
        "image": image_name(rig_camera, options),
        "image_size_px": list(camera.image_size_px),
        "sensor_width_mm": camera.sensor_size_mm[0],
        "sensor_height_mm": camera.sensor_size_mm[1],
        "focal_length_mm": camera.focal_length_mm,
        # A shift moves the view: the principal point goes the other way, and y is up.
        "shift_x": -float(right) / width + 0.0,
        "shift_y": float(down) / width + 0.0,
        "focus_distance_m": rig_camera.focus_distance_mm * METRES_PER_MM,
        "f_number": camera.f_number,
        distortion_key(camera): camera.distortion.tolist(),
        "matrix_world": graphics_camera_to_rig(rig_camera.pose, METRES_PER_MM).tolist(),
    }


def write(cameras: Cameras, options: ExportOptions) -> Files:
    """``cameras_blender.py``."""
    # ASCII only, so that no name can hold what would end the raw string.
    data = ",\n".join(json.dumps(_camera(camera, options)) for camera in cameras)
    return {"cameras_blender.py": _SCRIPT.replace("{cameras}", f"[{data}]").encode()}


FORMAT = Format(
    "blender",
    "Blender",
    "a Python script that builds the cameras",
    ("cameras_blender.py",),
    write,
    tuple(LensModel),
)
