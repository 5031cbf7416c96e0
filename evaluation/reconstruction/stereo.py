"""Coarse depth of one camera from semi-global matching with a partner (OpenCV).

The pair is warped so that rows correspond, whatever way the two cameras are rolled: x runs along
the base, and the partner's principal point is shifted so that the far end of the volume has
disparity 0. Depth is kept where matching left to right and right to left agrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from evaluation.reconstruction.views import Singles, View
from evaluation.reconstruction.volume import Volume
from geometry.arrays import Floats

AGREEMENT_PX = 1.0
_LARGEST_SIDE = 4000
_EIGHT_BITS = 255.0


@dataclass(frozen=True, eq=False)
class _Rectified:
    """A warped pair. ``into_*`` (3, 3) take pixels of each view to pixels of the warped one."""

    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    into_left: Floats
    rotation: Floats
    focal_px: float
    base_mm: float
    shift_px: float
    disparities: int


def coarse_inverse_depth(reference: View, partner: View, volume: Volume) -> Singles:
    """Inverse depth (1/mm, along the reference's axis) of its pixels, (H, W); NaN where unknown."""
    pair = _rectified(reference, partner, volume)
    disparity = _matched(pair)
    return _in_reference(disparity, pair, reference)


def _rectified(reference: View, partner: View, volume: Volume) -> _Rectified:
    base = partner.pose.position_rig_mm - reference.pose.position_rig_mm
    length = float(np.linalg.norm(base))
    x = base / length
    axis = reference.pose.rotation_rig_to_camera[2] + partner.pose.rotation_rig_to_camera[2]
    z = axis - (axis @ x) * x
    z = z / np.linalg.norm(z)
    rotation = np.array([x, np.cross(z, x), z])
    focal = float(reference.matrix[0, 0])
    depth = float((volume.centre_rig_mm - reference.pose.position_rig_mm) @ z)
    near = max(depth - volume.radius_mm, 0.3 * depth)
    far = depth + volume.radius_mm
    # One window for both, about the volume's middle: what lies outside it is not the subject.
    radius = focal * volume.radius_mm / near
    middle = rotation @ (volume.centre_rig_mm - reference.pose.position_rig_mm)
    centre = focal * middle[:2] / middle[2]
    side = int(min(2.0 * radius, 1.3 * max(reference.size_px), _LARGEST_SIDE))
    origin = centre - side / 2.0
    shift = focal * length / far
    matrix_left = np.array([[focal, 0.0, -origin[0]], [0.0, focal, -origin[1]], [0.0, 0.0, 1.0]])
    matrix_right = matrix_left.copy()
    matrix_right[0, 2] += shift
    span = focal * length / near - shift
    warps = [
        k @ rotation @ v.pose.rotation_rig_to_camera.T @ np.linalg.inv(v.matrix)
        for k, v in ((matrix_left, reference), (matrix_right, partner))
    ]
    images = [_warped(v, h, side) for v, h in zip((reference, partner), warps, strict=True)]
    disparities = 16 * max(1, int(np.ceil((span + 2.0) / 16.0)))
    return _Rectified(images[0], images[1], warps[0], rotation, focal, length, shift, disparities)


def _warped(view: View, homography: Floats, side: int) -> NDArray[np.uint8]:
    """Grey values stretched to 8 bits about their middle: SGBM knows nothing finer."""
    warped = cv2.warpPerspective(view.grey, homography, (side, side), flags=cv2.INTER_LINEAR)
    low, high = np.percentile(view.grey, (0.5, 99.5))
    scaled = (warped - low) * (_EIGHT_BITS / max(float(high - low), 1e-6))
    return np.asarray(np.clip(scaled, 0.0, _EIGHT_BITS), dtype=np.uint8)


def _matched(pair: _Rectified) -> Singles:
    """Disparities of the left picture, pixels; NaN where the two directions disagree."""
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=pair.disparities,
        blockSize=5,
        P1=8 * 25,
        P2=32 * 25,
        disp12MaxDiff=-1,
        uniquenessRatio=5,
        speckleWindowSize=100,
        speckleRange=2,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    pad = pair.disparities
    left = np.pad(pair.left, ((0, 0), (pad, pad)))
    right = np.pad(pair.right, ((0, 0), (pad, pad)))
    forward = _disparity(matcher, left, right, pad)
    # Right to left is left to right of the mirrored pair.
    backward = _disparity(matcher, right[:, ::-1].copy(), left[:, ::-1].copy(), pad)[:, ::-1]
    columns = np.arange(forward.shape[1])[None, :]
    there = np.clip(np.nan_to_num(columns - forward, nan=0.0), 0, forward.shape[1] - 1)
    back = np.take_along_axis(backward, np.rint(there).astype(np.int64), axis=1)
    agree = np.abs(forward - back) <= AGREEMENT_PX
    return np.where(agree & (pair.left > 0), forward, np.float32(np.nan))


def _disparity(
    matcher: cv2.StereoSGBM, left: NDArray[np.uint8], right: NDArray[np.uint8], pad: int
) -> Singles:
    found = matcher.compute(left, right).astype(np.float32)[:, pad:-pad] / 16.0
    return np.where(found > 0.0, found, np.float32(np.nan))


def _in_reference(disparity: Singles, pair: _Rectified, reference: View) -> Singles:
    """Inverse depth at the reference's own pixels from the warped picture's disparities."""
    w, h = reference.size_px
    back = cv2.warpPerspective(
        disparity, pair.into_left, (w, h), flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT, borderValue=float("nan"),
    )  # fmt: skip
    # Depth in the warped frame to depth along the reference's own axis: both about one centre.
    inverse_warped = (back + pair.shift_px) / (pair.focal_px * pair.base_mm)
    rays = _rays(reference)
    turned = rays @ (pair.rotation @ reference.pose.rotation_rig_to_camera.T)[2]
    return np.asarray(inverse_warped * turned, dtype=np.float32)


def _rays(view: View) -> Floats:
    w, h = view.size_px
    inverse = np.linalg.inv(view.matrix)
    u, v = np.meshgrid(np.arange(w, dtype=np.float64), np.arange(h, dtype=np.float64))
    return np.asarray(np.stack([u, v, np.ones_like(u)], axis=-1) @ inverse.T)
