"""Start values of interior orientations, camera by camera."""

from __future__ import annotations

import numpy as np
from scipy.linalg import rq

from calibration.adjustment.camera import Interior
from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.lenses import as_lens, fisheye_start
from calibration.adjustment.initialisation.resection import interior_from_planes
from calibration.adjustment.initialisation.views import View, is_planar
from calibration.observations import Observations
from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import LensModel

LEAST_FOR_PLANE = 6
LEAST_FOR_BODY = 8


def start_interiors(
    observations: Observations, views: tuple[View, ...], points_mm: Floats, lens: LensModel
) -> tuple[Interior, ...]:
    """Interiors of all cameras from views of known carriers; ``points_mm`` (m, 3), NaN unknown.

    Their lenses are of the model ``lens``.
    Raises :class:`InputError` for a camera whose views do not determine one.
    """
    return tuple(
        _interior(observations, [v for v in views if v.camera == k], points_mm, k, lens)
        for k in range(len(observations.cameras))
    )


def _interior(
    observations: Observations,
    views: list[View],
    points_mm: Floats,
    camera: int,
    lens: LensModel,
) -> Interior:
    width, height = (int(v) for v in observations.image_size_px[camera])
    planes, bodies = [], []
    for view in views:
        points = points_mm[observations.target[view.rows]]
        known = finite_rows(points)
        seen = points[known], observations.pixel[view.rows][known]
        if known.sum() >= LEAST_FOR_PLANE and is_planar(seen[0]):
            planes.append(seen)
        elif known.sum() >= LEAST_FOR_BODY and not is_planar(seen[0]):
            bodies.append(seen)
    if lens is LensModel.FISHEYE and (planes or bodies):
        found = fisheye_start([*planes, *bodies], (width, height))
        if found is not None:
            return found
    for points, pixels in sorted(bodies, key=lambda b: -len(b[0])):
        found = _from_body(points, pixels, (width, height))
        if found is not None:
            return as_lens(found, lens, (width, height))
    if planes:
        found = interior_from_planes(planes, (width, height), lens is LensModel.RATIONAL)
        if found is not None:
            return as_lens(found, lens, (width, height))
    raise InputError(
        "calibration-interior",
        f"the views of camera {observations.cameras[camera]!r} do not determine its focal length",
        "show it a plate at several tilts, give a start camera with the focal length, or where "
        "it sees more than 120 degrees calibrate with the fisheye model",
    )


def _from_body(points: Floats, pixels: Floats, size_px: tuple[int, int]) -> Interior | None:
    """Direct linear transformation: interior without distortion from points in space."""
    centre, spread = points.mean(axis=0), points.std()
    middle, reach = pixels.mean(axis=0), pixels.std()
    x = np.c_[(points - centre) / spread, np.ones(len(points))]
    u = (pixels - middle) / reach
    zero = np.zeros_like(x)
    rows = np.concatenate([np.c_[x, zero, -u[:, :1] * x], np.c_[zero, x, -u[:, 1:] * x]])
    _, sizes, vt = np.linalg.svd(rows, full_matrices=False)
    if sizes[-2] < 1e-7 * sizes[0]:
        return None
    matrix = vt[-1].reshape(3, 4)[:, :3]
    upper, _ = rq(matrix)
    upper = upper @ np.diag(np.sign(np.diag(upper)))
    upper = upper / upper[2, 2]
    f = reach * float(np.sqrt(upper[0, 0] * upper[1, 1]))
    if not (np.isfinite(f) and 0.2 < f / max(size_px) < 50.0):
        return None
    # Its principal point is worthless on a long lens; the adjustment finds a better one.
    return Interior(f, (np.array(size_px) - 1.0) / 2.0)
