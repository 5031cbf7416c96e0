"""How lenses bend: Brown-Conrady, rational and fisheye, forward and back, with all derivatives.

The one place of these equations, with OpenCV's order and signs of the terms. With ``x = X / Z``,
``y = Y / Z``, ``r2 = x x + y y`` all three are ``x g + dx``, ``y g + dy`` of a growth ``g``:

    brown     g = 1 + k1 r2 + k2 r2^2 + k3 r2^3
    rational  g = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
    both      dx = 2 p1 x y + p2 (r2 + 2 x x),  dy = p1 (r2 + 2 y y) + 2 p2 x y
    fisheye   g = a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8) / r,  a = atan r  (Kannala-Brandt)

How many terms a lens is given with says which model it is: (5,) k1, k2, p1, p2, k3; (8,) those and
k4, k5, k6; (4,) k1, k2, k3, k4. Leading dimensions are written ``...`` and broadcast.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from geometry.arrays import Bools, Floats, frozen


class LensModel(IntEnum):
    """The equations by which a lens bends."""

    BROWN = 0
    RATIONAL = 1
    FISHEYE = 2


TERM_COUNTS = {5: LensModel.BROWN, 8: LensModel.RATIONAL, 4: LensModel.FISHEYE}
"""Which model a lens with so many terms is of."""

TERM_NAMES = {
    LensModel.BROWN: ("k1", "k2", "p1", "p2", "k3"),
    LensModel.RATIONAL: ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    LensModel.FISHEYE: ("k1", "k2", "k3", "k4"),
}

NO_DISTORTION = frozen(np.zeros(5))

FULL = 9
"""k1, k2, p1, p2, k3, k4, k5, k6 and the number of the model: terms of any lens, side by side."""

_PLACES = {
    LensModel.BROWN: [0, 1, 2, 3, 4],
    LensModel.RATIONAL: [0, 1, 2, 3, 4, 5, 6, 7],
    LensModel.FISHEYE: [0, 1, 4, 5],
}
_NEAR_AXIS = 1e-6
_STEPS = 60
_HALVINGS = 60
_WIDEST = 1e4
"""x/z that no picture shows: 89.99 degrees off the axis."""
_FOUND = 1e-14
_ON_THE_SHEET = 1e-9


def model_of(distortion: Floats) -> LensModel:
    """The model of a lens with these terms, (4,), (5,) or (8,)."""
    return TERM_COUNTS[np.shape(distortion)[-1]]


def bends(distortion: Floats) -> bool:
    """Whether a lens with these terms differs from a central perspective."""
    return model_of(distortion) is LensModel.FISHEYE or bool(np.any(distortion))


def full_terms(distortion: Floats) -> Floats:
    """Terms (..., 9) of lenses given by (..., 4), (..., 5), (..., 8) or (..., 9)."""
    given = np.asarray(distortion, dtype=np.float64)
    if given.shape[-1] == FULL:
        return given
    model = model_of(given)
    out = np.zeros((*given.shape[:-1], FULL))
    out[..., _PLACES[model]], out[..., -1] = given, model
    return out


def own_terms(full: Floats) -> Floats:
    """The terms that a lens with ``full`` (9,) is given by: (4,), (5,) or (8,)."""
    return np.asarray(full[_PLACES[LensModel(round(float(full[-1])))]])


def distort(normalised: Floats, distortion: Floats) -> Floats:
    """Bent coordinates (..., 2) of normalised ones (..., 2).

    Beyond :func:`fold_radius` the polynomials turn back and stand for no lens any more; they are
    evaluated all the same.
    """
    terms = full_terms(distortion)
    x, y = normalised[..., 0], normalised[..., 1]
    r2, (p1, p2) = x * x + y * y, _decentring(terms)
    growth = _growth(r2, terms)
    dx = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    dy = p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.stack([x * growth + dx, y * growth + dy], axis=-1)


def distort_partials(normalised: Floats, distortion: Floats) -> tuple[Floats, Floats]:
    """Partials of :func:`distort` by x, y (..., 2, 2) and by its terms (..., 2, n).

    n is that of ``distortion`` (..., n); the number of the model has partials of zero.
    """
    terms = full_terms(distortion)
    p1, p2 = _decentring(terms)
    x, y = normalised[..., 0], normalised[..., 1]
    xx, yy, xy = x * x, y * y, x * y
    r2 = xx + yy
    growth, half_slope, by_radial = _growth_partials(r2, terms)
    slope = 2.0 * half_slope
    own = np.empty((*growth.shape, 2, 2))
    own[..., 0, 0] = growth + xx * slope + 2.0 * p1 * y + 6.0 * p2 * x
    own[..., 0, 1] = own[..., 1, 0] = xy * slope + 2.0 * p1 * x + 2.0 * p2 * y
    own[..., 1, 1] = growth + yy * slope + 6.0 * p1 * y + 2.0 * p2 * x
    by_terms = np.zeros((*growth.shape, 2, FULL))
    for column, partial in zip((0, 1, 4, 5, 6, 7), by_radial, strict=True):
        by_terms[..., 0, column], by_terms[..., 1, column] = x * partial, y * partial
    straight = terms[..., -1] != LensModel.FISHEYE
    by_terms[..., 0, 2] = by_terms[..., 1, 3] = 2.0 * xy * straight
    by_terms[..., 1, 2] = (r2 + 2.0 * yy) * straight
    by_terms[..., 0, 3] = (r2 + 2.0 * xx) * straight
    if np.shape(distortion)[-1] == FULL:
        return own, by_terms
    return own, by_terms[..., _PLACES[model_of(distortion)]]


def _decentring(terms: Floats) -> tuple[Floats, Floats]:
    """p1 and p2 (...), which a fisheye has not."""
    straight = terms[..., -1] != LensModel.FISHEYE
    return terms[..., 2] * straight, terms[..., 3] * straight


def _growth(r2: Floats, terms: Floats) -> Floats:
    """G (...) of squared radii (...) and terms (..., 9)."""
    k1, k2, _, _, k3, k4, k5, k6, model = np.moveaxis(terms, -1, 0)
    growth = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    if np.any(model == LensModel.RATIONAL):
        below = np.where(model == LensModel.RATIONAL, 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)), 1.0)
        growth = growth / below
    if np.any(model == LensModel.FISHEYE):
        radius, angle = _angles(r2)
        a2 = angle * angle
        bent = 1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))
        growth = np.where(model == LensModel.FISHEYE, angle / radius * bent, growth)
    return np.asarray(growth)


def _angles(r2: Floats) -> tuple[Floats, Floats]:
    """Radii x/z, no smaller than where angle and tangent are one, and angles off the axis."""
    radius = np.maximum(np.sqrt(r2), _NEAR_AXIS)
    return radius, np.arctan(radius)


def _growth_partials(r2: Floats, terms: Floats) -> tuple[Floats, Floats, list[Floats]]:
    """g, its partial by r2, and its partials by k1, k2, k3, k4, k5, k6; all (...)."""
    k1, k2, _, _, k3, k4, k5, k6, model = np.moveaxis(terms, -1, 0)
    growth = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3)
    none = np.zeros(np.broadcast_shapes(np.shape(r2), np.shape(k1)))
    by = [none + r2, none + r2**2, none + r2**3, none, none, none]
    rational, fisheye = model == LensModel.RATIONAL, model == LensModel.FISHEYE
    if np.any(rational):
        below = np.where(rational, 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)), 1.0)
        below_slope = np.where(rational, k4 + r2 * (2.0 * k5 + 3.0 * r2 * k6), 0.0)
        growth = growth / below
        slope = (slope - growth * below_slope) / below
        above = [p / below for p in by[:3]]
        by = above + [np.where(rational, -growth * p, 0.0) for p in above]
    if np.any(fisheye):
        radius, angle = _angles(r2)
        a2 = angle * angle
        share = angle / radius
        bent = 1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))
        rate = 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + 9.0 * a2 * k4)))
        growth = np.where(fisheye, share * bent, growth)
        # On the axis both rates are one, and their difference nothing but rounding.
        off = rate / (1.0 + radius * radius) - share * bent
        bow = np.where(radius > _NEAR_AXIS, off / (2.0 * radius * radius), k1 - 1.0 / 3.0)
        slope = np.where(fisheye, bow, slope)
        powers = [share * a2, share * a2**2, share * a2**3, share * a2**4, none, none]
        by = [np.where(fisheye, a, b) for a, b in zip(powers, by, strict=True)]
    return np.asarray(growth), np.asarray(slope), by


def fold_radius(distortion: Floats) -> float:
    """Radius x/z up to which the radial part of ``distortion`` grows; may be infinite.

    ``distortion`` (4,), (5,) or (8,). There the slope of ``r g`` is zero, and points further out
    would be imaged back inside; a rational lens ends where its divisor vanishes, too.
    """
    k1, k2, _, _, k3, k4, k5, k6, model = full_terms(distortion)
    if model == LensModel.FISHEYE:
        angle = np.sqrt(_smallest_root(np.array([1.0, 3 * k1, 5 * k2, 7 * k3, 9 * k4])))
        return float(np.tan(angle)) if angle < np.pi / 2.0 else np.inf
    slope = np.array([1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3])
    if model == LensModel.RATIONAL:
        above, below = np.array([1.0, k1, k2, k3]), np.array([1.0, k4, k5, k6])
        odd = np.array([0.0, 2.0, 4.0, 6.0])
        slope = np.convolve(slope, below) - np.convolve(above, odd * below)
        return float(np.sqrt(min(_smallest_root(slope), _smallest_root(below))))
    return float(np.sqrt(_smallest_root(slope)))


def _smallest_root(rising: Floats) -> float:
    """Smallest positive root of a polynomial with ``rising`` (n,) powers and a first of 1."""
    # In 1 / x the leading term is 1, so that vanishing terms do no harm.
    roots = np.roots(rising)
    real = roots.real[(np.abs(roots.imag) <= 1e-7 * np.abs(roots)) & (roots.real > 1e-12)]
    return float(1.0 / real.max()) if len(real) else np.inf


def undistort(distorted: Floats, distortion: Floats) -> Floats:
    """Inverse of :func:`distort` for one lens: (..., 2) with its terms (n,), (..., 2).

    Newton's method with halved steps where one does not help. Exact to rounding within the fold
    of the lens, to the square root of that on the fold. Coordinates that no point within the fold
    is imaged to give NaN.
    """
    target = np.asarray(distorted, dtype=np.float64).reshape(-1, 2)
    if not bends(distortion):
        return np.array(distorted, dtype=np.float64)
    fold, terms = fold_radius(distortion), full_terms(distortion)
    start = _equidistant(target) if terms[-1] == LensModel.FISHEYE else target
    found, good = _inverse_from(target, start, terms, fold)
    again = np.flatnonzero(~good)
    if len(again):
        # A lens that spreads its edge has targets beyond its own fold: from there Newton's steps
        # lead away. The radial part alone has one answer within the fold, which is near enough.
        start = _radially(target[again], terms, fold)
        found[again], good[again] = _inverse_from(target[again], start, terms, fold)
    return np.where(good[:, None], found, np.nan).reshape(np.shape(distorted))


def _inverse_from(
    target: Floats, start: Floats, terms: Floats, fold: float
) -> tuple[Floats, Bools]:
    """Inverse (n, 2) by Newton's method from a start (n, 2), and whether it is one (n,)."""
    found = start.copy()
    left = target - distort(found, terms)
    share = np.ones(len(found))
    open_ = np.flatnonzero(_size(left) > _FOUND)
    for _ in range(_STEPS):
        if len(open_) == 0:
            break
        step = _solved(distort_partials(found[open_], terms)[0], left[open_])
        trial = found[open_] + share[open_, None] * step
        misfit = target[open_] - distort(trial, terms)
        better = _size(misfit) < _size(left[open_])
        found[open_[better]], left[open_[better]] = trial[better], misfit[better]
        share[open_] = np.where(better, np.minimum(2.0 * share[open_], 1.0), 0.25 * share[open_])
        open_ = open_[(_size(left[open_]) > _FOUND) & (share[open_] > 1e-6)]
    own = distort_partials(found, terms)[0]
    upright = own[:, 0, 0] * own[:, 1, 1] - own[:, 0, 1] * own[:, 1, 0] >= -1e-6
    # Decentring moves the fold by its own small share; other sheets lie far beyond.
    within = np.hypot(found[:, 0], found[:, 1]) <= 1.1 * fold
    return found, upright & within & (_size(left) <= _ON_THE_SHEET)


def _equidistant(target: Floats) -> Floats:
    """Inverse (n, 2) for a fisheye without terms; the target where that looks backwards."""
    angle = np.maximum(np.hypot(target[:, 0], target[:, 1]), _NEAR_AXIS)
    forward = angle < np.arctan(_WIDEST)
    return target * np.where(forward, np.tan(np.where(forward, angle, 0.0)) / angle, 1.0)[:, None]


def _radially(target: Floats, terms: Floats, fold: float) -> Floats:
    """Inverse (n, 2) of the radial part within the fold; the fold where there is none."""
    wanted = np.hypot(target[:, 0], target[:, 1])
    low = np.zeros(len(target))
    high = np.full(len(target), min(fold, _WIDEST))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = middle * _growth(middle * middle, terms) < wanted
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
