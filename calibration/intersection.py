"""Multi-image forward intersection: object points from image points of known cameras."""

from __future__ import annotations

import numpy as np

from common.errors import InputError
from geometry.arrays import Bools, Floats
from geometry.camera import RigCamera, undistort

_ITERATIONS = 12


def intersect(cameras: tuple[RigCamera, ...], pixels: Floats, seen: Bools) -> Floats:
    """Least-squares points (p, 3), mm in the rig frame, from their images.

    ``pixels`` (n, p, 2) are observed image points with equal weights, ``seen`` (n, p) says
    which were observed. Gauss-Newton on the reprojection error from the linear solution; the
    partials are those of the collinearity equations (the paper's Eq 5). Points observed by
    fewer than two cameras are NaN. Raises :class:`InputError` when the shapes do not fit.
    """
    if pixels.shape != (len(cameras), seen.shape[1], 2) or len(seen) != len(cameras):
        raise InputError(
            "observations-shape", "observations do not fit the cameras", "give cameras x points x 2"
        )
    rays = np.stack([_normalised(c, xy) for c, xy in zip(cameras, pixels, strict=True)])
    weight = np.where(seen, np.array([[c.camera.focal_length_px] for c in cameras]), 0.0)
    rotations = np.stack([c.pose.rotation_rig_to_camera for c in cameras])
    centres = np.stack([c.pose.position_rig_mm for c in cameras])
    points = _linear(rays, weight, rotations, centres)
    for _ in range(_ITERATIONS):
        move = _step(points, rays, weight, rotations, centres)
        points = points + move
        if np.nanmax(np.abs(move), initial=0.0) < 1e-9:
            break
    points[seen.sum(axis=0) < 2] = np.nan
    return points


def _normalised(camera: RigCamera, pixels: Floats) -> Floats:
    kind = camera.camera
    distorted = (pixels - kind.principal_point_px) / kind.focal_length_px
    return undistort(np.nan_to_num(distorted), kind.distortion)


def _linear(rays: Floats, weight: Floats, rotations: Floats, centres: Floats) -> Floats:
    """Points nearest to all their rays, (p, 3)."""
    ways = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=2)
    ways = np.einsum("npk,nkm->npm", ways, rotations)
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    across = np.eye(3) - ways[..., :, None] * ways[..., None, :]
    across *= (weight > 0.0)[..., None, None]
    normal = across.sum(axis=0) + 1e-12 * np.eye(3)
    right = np.einsum("npkm,nm->pk", across, centres)
    return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0])


def _step(
    points: Floats, rays: Floats, weight: Floats, rotations: Floats, centres: Floats
) -> Floats:
    """One Gauss-Newton step (p, 3) on the weighted reprojection errors."""
    local = np.einsum("nkm,npm->npk", rotations, points[None] - centres[:, None])
    x, y, z = local[..., 0], local[..., 1], local[..., 2]
    partial_x = (rotations[:, None, 0] - (x / z)[..., None] * rotations[:, None, 2]) / z[..., None]
    partial_y = (rotations[:, None, 1] - (y / z)[..., None] * rotations[:, None, 2]) / z[..., None]
    partials = np.stack([partial_x, partial_y], axis=2) * weight[..., None, None]
    misfit = (rays - np.stack([x / z, y / z], axis=2)) * weight[..., None]
    normal = np.einsum("npak,npam->pkm", partials, partials)
    normal += 1e-12 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(
        3
    ) + 1e-30 * np.eye(3)
    right = np.einsum("npak,npa->pk", partials, misfit)
    return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0])
