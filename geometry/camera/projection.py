"""Central perspective and Brown-Conrady distortion, forward and back, with all derivatives.

The one place of these equations (OpenCV's order and signs of the terms). With the point
``X_c = R (X - C)`` in the camera frame, ``x = X_c / Z_c``, ``y = Y_c / Z_c``, ``r2 = x x + y y``:

    x' = x (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 x y + p2 (r2 + 2 x x)
    y' = y (1 + k1 r2 + k2 r2^2 + k3 r2^3) + p1 (r2 + 2 y y) + 2 p2 x y
    x_px = f (1 + b1) x' + cx,   y_px = f y' + cy

All functions are vectorised: leading dimensions are written ``...`` and broadcast.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Bools, Floats, frozen

INTERIOR_NAMES = ("f", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "b1")
"""Interior parameters in their order everywhere: px, px, px, then without unit."""

NO_DISTORTION = frozen(np.zeros(5))

_STEPS = 60
_HALVINGS = 40
_FOUND = 1e-14
_ON_THE_SHEET = 1e-9


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


def distort(normalised: Floats, distortion: Floats) -> Floats:
    """Brown-Conrady distortion of normalised coordinates (..., 2), (..., 2).

    ``distortion`` (5,) or (..., 5) holds k1, k2, p1, p2, k3. Beyond :func:`fold_radius` the
    polynomial turns back and stands for no lens any more; it is evaluated all the same.
    """
    k1, k2, p1, p2, k3 = np.moveaxis(np.asarray(distortion), -1, 0)
    x, y = normalised[..., 0], normalised[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    dx = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    dy = p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.stack([x * radial + dx, y * radial + dy], axis=-1)


def distort_partials(normalised: Floats, distortion: Floats) -> tuple[Floats, Floats]:
    """Partials of :func:`distort` by x, y (..., 2, 2) and by k1, k2, p1, p2, k3 (..., 2, 5)."""
    k1, k2, p1, p2, k3 = np.moveaxis(np.asarray(distortion), -1, 0)
    x, y = normalised[..., 0], normalised[..., 1]
    xx, yy, xy = x * x, y * y, x * y
    r2 = xx + yy
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))
    own = np.empty((*radial.shape, 2, 2))
    own[..., 0, 0] = radial + xx * slope + 2.0 * p1 * y + 6.0 * p2 * x
    own[..., 0, 1] = own[..., 1, 0] = xy * slope + 2.0 * p1 * x + 2.0 * p2 * y
    own[..., 1, 1] = radial + yy * slope + 6.0 * p1 * y + 2.0 * p2 * x
    terms = np.empty((*r2.shape, 2, 5))
    power = r2
    for column in (0, 1, 4):
        terms[..., 0, column], terms[..., 1, column] = x * power, y * power
        power = power * r2
    terms[..., 0, 2] = terms[..., 1, 3] = 2.0 * xy
    terms[..., 1, 2], terms[..., 0, 3] = r2 + 2.0 * yy, r2 + 2.0 * xx
    return own, terms


def fold_radius(distortion: Floats) -> float:
    """Radius x/z up to which the radial part of ``distortion`` (5,) grows; may be infinite.

    There its slope 1 + 3 k1 r2 + 5 k2 r2^2 + 7 k3 r2^3 is zero, and points further out would be
    imaged back inside.
    """
    k1, k2, _, _, k3 = distortion
    # In 1 / r2 the leading term is 1, so that vanishing terms do no harm.
    roots = np.roots([1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3])
    real = roots.real[(np.abs(roots.imag) <= 1e-7 * np.abs(roots)) & (roots.real > 1e-12)]
    return float(1.0 / np.sqrt(real.max())) if len(real) else np.inf


def undistort(distorted: Floats, distortion: Floats) -> Floats:
    """Inverse of :func:`distort` for one lens: (..., 2) with ``distortion`` (5,), (..., 2).

    Newton's method with halved steps where one does not help. Exact to rounding within the fold
    of the lens, to the square root of that on the fold. Coordinates that no point within the fold
    is imaged to give NaN.
    """
    target = np.asarray(distorted, dtype=np.float64).reshape(-1, 2)
    if not np.any(distortion):
        return np.array(distorted, dtype=np.float64)
    fold = fold_radius(distortion)
    found, good = _inverse_from(target, target, distortion, fold)
    again = np.flatnonzero(~good)
    if len(again):
        # A lens that spreads its edge has targets beyond its own fold: from there Newton's steps
        # lead away. The radial part alone has one answer within the fold, which is near enough.
        start = _radially(target[again], distortion, fold)
        found[again], good[again] = _inverse_from(target[again], start, distortion, fold)
    return np.where(good[:, None], found, np.nan).reshape(np.shape(distorted))


def _inverse_from(
    target: Floats, start: Floats, distortion: Floats, fold: float
) -> tuple[Floats, Bools]:
    """Inverse (n, 2) by Newton's method from a start (n, 2), and whether it is one (n,)."""
    found = start.copy()
    left = target - distort(found, distortion)
    share = np.ones(len(found))
    open_ = np.flatnonzero(_size(left) > _FOUND)
    for _ in range(_STEPS):
        if len(open_) == 0:
            break
        step = _solved(distort_partials(found[open_], distortion)[0], left[open_])
        trial = found[open_] + share[open_, None] * step
        misfit = target[open_] - distort(trial, distortion)
        better = _size(misfit) < _size(left[open_])
        found[open_[better]], left[open_[better]] = trial[better], misfit[better]
        share[open_] = np.where(better, np.minimum(2.0 * share[open_], 1.0), 0.25 * share[open_])
        open_ = open_[(_size(left[open_]) > _FOUND) & (share[open_] > 1e-6)]
    own = distort_partials(found, distortion)[0]
    upright = own[:, 0, 0] * own[:, 1, 1] - own[:, 0, 1] * own[:, 1, 0] >= -1e-6
    # Decentring moves the fold by its own small share; other sheets lie far beyond.
    within = np.hypot(found[:, 0], found[:, 1]) <= 1.1 * fold
    return found, upright & within & (_size(left) <= _ON_THE_SHEET)


def _radially(target: Floats, distortion: Floats, fold: float) -> Floats:
    """Inverse (n, 2) of the radial part within the fold; the fold where there is none."""
    k1, k2, _, _, k3 = distortion
    wanted = np.hypot(target[:, 0], target[:, 1])
    low = np.zeros(len(target))
    # Without a fold the polynomial grows for ever, and is at least a share of x beyond 1.
    high = np.full(len(target), fold) if np.isfinite(fold) else 10.0 * np.maximum(wanted, 1.0)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        r2 = middle * middle
        below = middle * (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) < wanted
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return target * (low / np.maximum(wanted, 1e-300))[:, None]


def _size(vectors: Floats) -> Floats:
    return np.asarray(np.abs(vectors).max(axis=-1))


def _solved(matrix: Floats, right: Floats) -> Floats:
    """Solutions (n, 2) of n systems of two equations; a singular one keeps its step finite."""
    a, b, c, d = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 0], matrix[:, 1, 1]
    determinant = a * d - b * c
    safe = np.where(np.abs(determinant) < 1e-12, 1e-12, determinant)
    u, v = right[:, 0], right[:, 1]
    return np.stack([(d * u - b * v) / safe, (a * v - c * u) / safe], axis=1)


def interior_vector(
    focal_length_px: float,
    principal_point_px: Floats,
    distortion: Floats = NO_DISTORTION,
    affinity: float = 0.0,
) -> Floats:
    """The parameters (9,) in the order of :data:`INTERIOR_NAMES`."""
    return np.array([focal_length_px, *principal_point_px, *distortion, affinity])


def project(points_camera_mm: Floats, interior: Floats) -> tuple[Floats, Floats]:
    """Pixels (..., 2) and depths (...) in mm of points (..., 3) in the camera frame.

    ``interior`` (9,) or (..., 9) in the order of :data:`INTERIOR_NAMES`. Pixels at depths of 0 or
    less mean nothing but are finite, so that sums which weigh them with zero stay so.
    """
    depth = points_camera_mm[..., 2]
    normalised = points_camera_mm[..., :2] / np.where(depth > 0.0, depth, 1.0)[..., None]
    return _pixels(distort(normalised, interior[..., 3:8]), interior), depth


def _pixels(distorted: Floats, interior: Floats) -> Floats:
    f, stretch = interior[..., 0], 1.0 + interior[..., 8]
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
    small turn w about its own axes (``R -> exp(w) R``) in px/rad; by the interior (..., 2, 9) in
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
    distorted = distort(normalised, interior[..., 3:8])
    own, terms = distort_partials(normalised, interior[..., 3:8])
    f, stretch = interior[..., 0], 1.0 + interior[..., 8]
    scale = np.stack(np.broadcast_arrays(f * stretch, f), axis=-1)[..., None]
    by_camera = np.empty((*depth.shape, 2, 3))
    by_camera[..., :2] = scale * own / safe[..., None, None]
    by_camera[..., 2] = -np.einsum("...ij,...j->...i", by_camera[..., :2], normalised)
    by_interior = np.zeros((*depth.shape, 2, 9))
    by_interior[..., 0, 0], by_interior[..., 1, 0] = stretch * distorted[..., 0], distorted[..., 1]
    by_interior[..., 0, 1] = by_interior[..., 1, 2] = 1.0
    by_interior[..., 3:8] = scale * terms
    by_interior[..., 0, 8] = f * distorted[..., 0]
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
