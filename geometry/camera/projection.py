"""Central perspective and interior orientation, with all derivatives.

The one place of these equations. With the point ``X_c = R (X - C)`` in the camera frame,
``x = X_c / Z_c``, ``y = Y_c / Z_c`` and x', y' what the lens makes of them
(:mod:`geometry.camera.distortion`):

    x_px = f (1 + b1) x' + cx,   y_px = f y' + cy

All functions are vectorised: leading dimensions are written ``...`` and broadcast.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from geometry.camera.distortion import (
    NO_DISTORTION,
    distort,
    distort_partials,
    full_terms,
)

INTERIOR_NAMES = (
    *("f", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "b1", "k4", "k5", "k6"),
    "lens",
)
"""Interior parameters in their order everywhere: px, px, px, then without unit.

The last is the number of the lens model, which nothing adjusts. The fisheye's k4 is with k4.
"""

INTERIOR = len(INTERIOR_NAMES)
STRETCH = INTERIOR_NAMES.index("b1")
_TERMS = [k for k in range(3, INTERIOR) if k != STRETCH]


def perspective(points_camera_mm: Floats) -> Floats:
    """Normalised coordinates x/z, y/z (..., 2) of points (..., 3); NaN at depths of 0 or less."""
    depth = points_camera_mm[..., 2:]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(depth > 0.0, points_camera_mm[..., :2] / depth, np.nan)


def perspective_partials(points_camera_mm: Floats) -> Floats:
    """Partials (..., 2, 3), 1/mm, of :func:`perspective` by points (..., 3) of positive depth."""
    x, y, z = points_camera_mm[..., 0], points_camera_mm[..., 1], points_camera_mm[..., 2]
    out = np.zeros((*points_camera_mm.shape[:-1], 2, 3))
    out[..., 0, 0] = out[..., 1, 1] = 1.0 / z
    out[..., 0, 2], out[..., 1, 2] = -x / (z * z), -y / (z * z)
    return out


def interior_vector(
    focal_length_px: float,
    principal_point_px: Floats,
    distortion: Floats = NO_DISTORTION,
    affinity: float = 0.0,
) -> Floats:
    """The parameters (13,) in the order of :data:`INTERIOR_NAMES`."""
    out = np.empty(INTERIOR)
    out[0], out[1:3], out[STRETCH] = focal_length_px, principal_point_px, affinity
    out[_TERMS] = full_terms(distortion)
    return out


def lens_terms(interior: Floats) -> Floats:
    """Distortion (..., 13) of parameters (..., 13), as :func:`full_terms` has it."""
    return np.asarray(interior[..., _TERMS])


def project(points_camera_mm: Floats, interior: Floats) -> tuple[Floats, Floats]:
    """Pixels (..., 2) and depths (...) in mm of points (..., 3) in the camera frame.

    ``interior`` (13,) or (..., 9) in the order of :data:`INTERIOR_NAMES`. Pixels at depths of 0 or
    less mean nothing but are finite, so that sums which weigh them with zero stay so.
    """
    depth = points_camera_mm[..., 2]
    normalised = points_camera_mm[..., :2] / np.where(depth > 0.0, depth, 1.0)[..., None]
    return _pixels(distort(normalised, lens_terms(interior)), interior), depth


def _pixels(distorted: Floats, interior: Floats) -> Floats:
    f, stretch = interior[..., 0], 1.0 + interior[..., STRETCH]
    return np.stack(
        [
            f * stretch * distorted[..., 0] + interior[..., 1],
            f * distorted[..., 1] + interior[..., 2],
        ],
        axis=-1,
    )


@dataclass(frozen=True, eq=False)
class ImagePartials:
    """Pixels (..., 2), depths (...) in mm, and partials of the pixels.

    By the point in the camera frame (..., 2, 3), px/mm; by the point in the rig frame
    (..., 2, 3), px/mm; by the camera's pose (..., 2, 6), its projection centre in px/mm and a
    small turn w about its own axes (``R -> exp(w) R``) in px/rad; by the interior (..., 2, 13) in
    the order of :data:`INTERIOR_NAMES`.
    """

    pixels: Floats
    depth_mm: Floats
    by_point_camera: Floats
    by_point: Floats
    by_pose: Floats
    by_interior: Floats


def project_partials(
    points_camera_mm: Floats, rotation_rig_to_camera: Floats, interior: Floats
) -> ImagePartials:
    """:func:`project` with all partials; depths must be positive for them to mean anything.

    ``rotation_rig_to_camera`` (3, 3) or (..., 3, 3) turns the partials into the rig's axes.
    """
    depth = points_camera_mm[..., 2]
    safe = np.where(depth > 0.0, depth, 1.0)
    normalised = points_camera_mm[..., :2] / safe[..., None]
    distorted = distort(normalised, lens_terms(interior))
    own, terms = distort_partials(normalised, lens_terms(interior))
    f, stretch = interior[..., 0], 1.0 + interior[..., STRETCH]
    scale = np.stack(np.broadcast_arrays(f * stretch, f), axis=-1)[..., None]
    by_camera = np.empty((*depth.shape, 2, 3))
    by_camera[..., :2] = scale * own / safe[..., None, None]
    by_camera[..., 2] = -np.einsum("...ij,...j->...i", by_camera[..., :2], normalised)
    by_interior = np.zeros((*depth.shape, 2, INTERIOR))
    by_interior[..., 0, 0], by_interior[..., 1, 0] = stretch * distorted[..., 0], distorted[..., 1]
    by_interior[..., 0, 1] = by_interior[..., 1, 2] = 1.0
    by_interior[..., _TERMS] = scale * terms
    by_interior[..., 0, STRETCH] = f * distorted[..., 0]
    by_point = by_camera @ rotation_rig_to_camera
    by_pose = np.concatenate([-by_point, rotation_partials(points_camera_mm, by_camera)], axis=-1)
    pixels = _pixels(distorted, interior)
    return ImagePartials(pixels, depth, by_camera, by_point, by_pose, by_interior)


def rotation_partials(vectors: Floats, by_vector: Floats) -> Floats:
    """Partials (..., k, 3) by w of k functions of ``exp(w) v``, at w = 0.

    ``vectors`` (..., 3) are the v, ``by_vector`` (..., k, 3) the functions' partials by them.
    """
    a, b, c = (vectors[..., k, None] for k in range(3))
    p, q, r = by_vector[..., 0], by_vector[..., 1], by_vector[..., 2]
    return np.stack([b * r - c * q, c * p - a * r, a * q - b * p], axis=-1)
