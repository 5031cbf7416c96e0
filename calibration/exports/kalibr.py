"""Kalibr's camchain YAML: a chain of cameras, each from the one before it, in metres."""

from __future__ import annotations

import numpy as np

from calibration.adjustment.camera import CalibratedCamera
from calibration.exports.text import METRE, matrix_rows, numbers, quoted, translation_mm
from geometry.arrays import Floats
from geometry.errors import InputError

WORST_PX = 0.05
"""radtan has no k3; k1 and k2 must be able to stand in for it this well."""


def kalibr_yaml(cameras: tuple[CalibratedCamera, ...]) -> str:
    """``camchain.yaml`` with pinhole cameras and radtan distortion (k1, k2, p1, p2).

    A k3 is taken into k1 and k2 as well as the image allows. Raises :class:`InputError` when
    that leaves more than :data:`WORST_PX`.
    """
    lines = []
    before: CalibratedCamera | None = None
    for k, camera in enumerate(cameras):
        matrix = camera.interior.camera_matrix
        lines += [
            f"cam{k}:",
            "  camera_model: pinhole",
            f"  intrinsics: [{numbers([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]])}]",
            "  distortion_model: radtan",
            f"  distortion_coeffs: [{numbers(radtan(camera))}]",
            f"  resolution: [{camera.image_size_px[0]}, {camera.image_size_px[1]}]",
            f"  rostopic: {quoted('/' + camera.name + '/image_raw')}",
        ]
        if before is not None:
            lines.append(f"  T_cn_cnm1: {matrix_rows(_from_before(camera, before))}")
        before = camera
    return "\n".join(lines) + "\n"


def radtan(camera: CalibratedCamera) -> Floats:
    """k1, k2, p1, p2 (4,) that do what all five terms do within the image."""
    k1, k2, p1, p2, k3 = camera.interior.distortion
    if k3 == 0.0:
        return np.array([k1, k2, p1, p2])
    width, height = camera.image_size_px
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]]) - 0.5
    reach = float(np.linalg.norm(camera.interior.normalised(corners), axis=1).max())
    r = np.linspace(0.0, reach, 200)[1:]
    # What counts is the shift in the image, r times the radial factor.
    rows = np.stack([r**3, r**5], axis=1)
    terms = np.linalg.lstsq(rows, rows @ [k1, k2] + k3 * r**7, rcond=None)[0]
    off = np.abs(rows @ terms - rows @ [k1, k2] - k3 * r**7).max() * camera.interior.focal_length_px
    if off > WORST_PX:
        raise InputError(
            "export-kalibr-k3",
            f"camera {camera.name!r} has a k3 that Kalibr's radtan model lacks ({off:.2g} px)",
            "calibrate with k3 fixed at 0, or use another format",
        )
    return np.array([*terms, p1, p2])


def _from_before(camera: CalibratedCamera, before: CalibratedCamera) -> Floats:
    out = np.eye(4)
    turn = camera.pose.rotation_rig_to_camera @ before.pose.rotation_rig_to_camera.T
    out[:3, :3] = turn
    out[:3, 3] = METRE * (translation_mm(camera) - turn @ translation_mm(before))
    return out
