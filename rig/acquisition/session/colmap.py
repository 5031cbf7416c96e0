"""COLMAP's ``rig_config.json``, by which it knows a session's pictures as those of one rig.

COLMAP takes the pose of each camera seen from a reference camera, and finds pictures by folder. Its
image path is the session's folder ``images``. Lengths stay millimetres.
"""

from __future__ import annotations

from collections.abc import Mapping

from geometry.camera import Camera, LensModel, RigCamera
from geometry.exchange.conventions import corner_principal_point_px, quaternion_wxyz

RIG = "rig1"


def rig_config(cameras: Mapping[str, RigCamera]) -> list[dict[str, object]]:
    """The rig as COLMAP reads it; the reference is the first camera in alphabetical order."""
    names = sorted(cameras)
    reference = cameras[names[0]]
    return [{"cameras": [_camera(name, cameras[name], reference) for name in names]}]


def _camera(name: str, placed: RigCamera, reference: RigCamera) -> dict[str, object]:
    entry: dict[str, object] = {"image_prefix": f"{RIG}/{name}/"}
    if placed is reference:
        entry["ref_sensor"] = True
    else:
        ours, theirs = placed.pose, reference.pose
        rotation = ours.rotation_rig_to_camera @ theirs.rotation_rig_to_camera.T
        shift = theirs.position_rig_mm - ours.position_rig_mm
        entry["cam_from_rig_rotation"] = quaternion_wxyz(rotation).tolist()
        entry["cam_from_rig_translation"] = (ours.rotation_rig_to_camera @ shift).tolist()
    fisheye = placed.camera.lens_model is LensModel.FISHEYE
    entry["camera_model_name"] = "OPENCV_FISHEYE" if fisheye else "FULL_OPENCV"
    entry["camera_params"] = lens_parameters(placed.camera)
    return entry


def lens_parameters(camera: Camera) -> list[float]:
    """fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6 with COLMAP's pixel centres.

    Of a fisheye fx, fy, cx, cy, k1, k2, k3, k4.
    """
    f, (cx, cy) = camera.focal_length_px, corner_principal_point_px(camera)
    terms = camera.distortion.tolist()
    none = [0.0, 0.0, 0.0] if camera.lens_model is LensModel.BROWN else []
    return [f, f, float(cx), float(cy), *terms, *none]
