"""Kalibr: a camchain, each camera placed from the one before it.

World to camera as everywhere, ``T_cn_cnm1`` leads from the camera before to this one, metres,
pixel centres at integers. The model radtan has k1, k2, p1 and p2, and no k3; equidistant is the
fisheye.
"""

from __future__ import annotations

import json

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import Camera, LensModel, RigCamera, distort_partials
from geometry.exchange.base import Cameras, ExportOptions, Files, Format
from geometry.exchange.conventions import METRES_PER_MM, number_lists, translation_mm

WORST_PX = 0.05
"""k1 and k2 must be able to stand in for a k3 this well."""


def radtan(camera: Camera, name: str) -> Floats:
    """k1, k2, p1, p2 (4,) that do what all five terms do within the image.

    Raises :class:`InputError` when that leaves more than :data:`WORST_PX`.
    """
    k1, k2, p1, p2, k3 = camera.distortion
    if k3 == 0.0:
        return np.array([k1, k2, p1, p2])
    width, height = camera.image_size_px
    corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]]) - 0.5
    reach = float(np.linalg.norm(camera.normalised(corners), axis=1).max())
    outward = np.linspace(0.0, reach, 200)[1:, None] * [1.0, 0.0]
    # What counts is the shift in the image.
    shift = distort_partials(outward, camera.distortion)[1][:, 0]
    powers, wanted = shift[:, :2], shift[:, [0, 1, 4]] @ [k1, k2, k3]
    terms = np.linalg.lstsq(powers, wanted, rcond=None)[0]
    off_px = float(np.abs(powers @ terms - wanted).max() * camera.focal_length_px)
    if off_px > WORST_PX:
        raise InputError(
            "export-kalibr-k3",
            f"camera {name!r} has a k3 that Kalibr's radtan model lacks ({off_px:.2g} px)",
            "calibrate with k3 fixed at 0, or use another format",
        )
    return np.array([*terms, p1, p2])


def _from_before(camera: RigCamera, before: RigCamera) -> Floats:
    matrix = np.eye(4)
    turn = camera.pose.rotation_rig_to_camera @ before.pose.rotation_rig_to_camera.T
    shift = translation_mm(camera.pose) - turn @ translation_mm(before.pose)
    matrix[:3, :3], matrix[:3, 3] = turn, shift * METRES_PER_MM
    return matrix


def write(cameras: Cameras, _options: ExportOptions) -> Files:
    """``camchain.yaml``: pinhole cameras with radtan or equidistant distortion."""
    lines: list[str] = []
    for index, one in enumerate(cameras):
        kind = one.camera
        fisheye = kind.lens_model is LensModel.FISHEYE
        terms = kind.distortion if fisheye else radtan(kind, one.name)
        f, (cx, cy) = kind.focal_length_px, kind.principal_point_px
        lines += [
            f"cam{index}:",
            "  camera_model: pinhole",
            f"  intrinsics: {number_lists(np.array([f, f, cx, cy]))}",
            f"  distortion_model: {'equidistant' if fisheye else 'radtan'}",
            f"  distortion_coeffs: {number_lists(terms)}",
            f"  resolution: [{kind.image_size_px[0]}, {kind.image_size_px[1]}]",
            # JSON's quotes are YAML's: a name with a colon must stay a string.
            f"  rostopic: {json.dumps(f'/{one.name}/image_raw', ensure_ascii=False)}",
        ]
        if index:
            lines.append(f"  T_cn_cnm1: {number_lists(_from_before(one, cameras[index - 1]))}")
    return {"camchain.yaml": ("\n".join(lines) + "\n").encode()}


FORMAT = Format(
    "kalibr",
    "Kalibr",
    "a camchain of pinhole cameras with radtan or equidistant distortion",
    ("camchain.yaml",),
    write,
    (LensModel.BROWN, LensModel.FISHEYE),
)
