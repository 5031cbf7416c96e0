"""Corners of a chessboard to a hundredth of a pixel: a blurred saddle fitted to grey levels.

The model is the product of two straight edges, blurred by one Gaussian (lens and pixel
together). Two edges that cross at an angle blur into more than the product of two blurred edges;
the rest is an integral over their correlation (Drezner and Wesolowsky 1990), taken with a few
Gauss nodes. Each line may bow a little, as lines do under lens distortion. The picture of a
corner is the same when turned by half a turn, and so is the model, so that what the model lacks
widens the stated sigma but moves the corner hardly at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import erf

from geometry.arrays import Bools, Floats

PARAMETERS = 11
"""x, y, two angles, blur, mean, half contrast, slope x, slope y, two bows."""

BOW_SIGMA = 5e-5
"""Prior sigma of a line's bow, 1/px: a lens with k1 = -0.3 bows lines by about as much."""

GUARD = 2.7
"""How many sigmas of blur from an edge a pixel must be to show nothing of it (0.7 % are left)."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_STEPS, _FULL_STEPS = 12, 6
_ENOUGH_PX = 1e-3
"""The last step is taken: what is left after one of this size is far smaller."""
_SMALLEST_BLUR, _LARGEST_BLUR = 0.35, 6.0


@dataclass(frozen=True, eq=False)
class Windows:
    """Grey levels about each corner.

    ``values`` (n, p) at ``offsets_px`` (p, 2) from ``anchors_px`` (n, 2), whole pixels.
    """

    values: Floats
    offsets_px: Floats
    anchors_px: Floats


@dataclass(frozen=True, eq=False)
class Saddles:
    """Fitted corners, one row each.

    ``pixel`` (n, 2); ``covariance_px2`` (n, 2, 2) from the residuals; ``blur_px``, ``contrast``
    (half the step, negative when the wrong quadrants are bright), ``noise`` (rms residual),
    all (n,); ``converged`` (n,).
    """

    pixel: Floats
    covariance_px2: Floats
    blur_px: Floats
    contrast: Floats
    noise: Floats
    converged: Bools


def fit_saddles(windows: Windows, start_px: Floats, axes_px: Floats, guard: GuardRule) -> Saddles:
    """Fit a saddle in each window.

    ``start_px`` (n, 2) where the corners are thought to be; ``axes_px`` (n, 2, 2) columns: the
    steps in pixels to the next corner along the board's x and y; the quadrants where both
    board coordinates have one sign are taken as the bright ones. ``guard`` says which pixels
    show nothing but the corner.
    """
    state = _start(windows, start_px, axes_px)
    for step in range(_STEPS):
        weight = guard.weights(windows, windows.anchors_px + state[:, :2], axes_px, state[:, 4])
        residual, partials = _model(windows, state)
        if step == 0:
            state = _linear_start(state, windows.values, weight, partials)
            continue
        normal, right, noise = _normal_equations(residual, partials, weight, state)
        move = _solve(normal, right)
        # A step beyond the edge's width would leave the range in which the edge has a slope.
        size = np.abs(move[:, :2]).max(axis=1) / np.maximum(state[:, 4], 0.5)
        # Cameras that sharpen make edges steeper than any blur; full steps then go to and fro.
        calm = 1.0 if step < _FULL_STEPS else 0.5
        state = state + calm * move / np.maximum(size, 1.0)[:, None]
        state[:, 4] = np.clip(state[:, 4], _SMALLEST_BLUR, _LARGEST_BLUR)
        largest = np.abs(move[:, :2]).max(axis=1)
        if largest.max(initial=0.0) < _ENOUGH_PX:
            break
    covariance = _inverse(normal)[:, :2, :2] * (noise**2)[:, None, None]
    pixel = windows.anchors_px + state[:, :2]
    return Saddles(pixel, covariance, state[:, 4], state[:, 6], noise, largest < 0.02)


@dataclass(frozen=True)
class GuardRule:
    """Which pixels of a window show the corner and nothing else.

    The squares in which both board coordinates have one sign hold markers from ``margin_squares``
    (in squares) inwards; the others are plain.
    """

    margin_squares: float

    def weights(
        self, windows: Windows, centre_px: Floats, axes_px: Floats, blur_px: Floats
    ) -> Floats:
        """Weight of each pixel, 0 or 1, (n, p)."""
        place = windows.offsets_px[None] - (centre_px - windows.anchors_px)[:, None]
        board = np.einsum("nij,npj->npi", _inverse(axes_px), place)
        u, v = np.abs(board[..., 0]), np.abs(board[..., 1])
        # How far the blur of an edge reaches, in squares.
        area = np.abs(np.linalg.det(axes_px))
        guard_u = (GUARD * blur_px * np.linalg.norm(axes_px[:, :, 1], axis=1) / area)[:, None]
        guard_v = (GUARD * blur_px * np.linalg.norm(axes_px[:, :, 0], axis=1) / area)[:, None]
        bright = board[..., 0] * board[..., 1] > 0.0
        near = (u < self.margin_squares - guard_u) | (v < self.margin_squares - guard_v)
        near |= (u < 0.5 * self.margin_squares) | (v < 0.5 * self.margin_squares)
        inside = (u < 1.0 - guard_u) & (v < 1.0 - guard_v)
        return np.asarray((inside & (near | ~bright)).astype(np.float64))


def _start(windows: Windows, start_px: Floats, axes_px: Floats) -> Floats:
    state = np.zeros((len(start_px), PARAMETERS))
    state[:, :2] = start_px - windows.anchors_px
    turn = np.sign(np.linalg.det(axes_px))
    along_v, along_u = axes_px[:, :, 1], axes_px[:, :, 0]
    state[:, 2] = np.arctan2(-along_v[:, 0] * turn, along_v[:, 1] * turn)
    state[:, 3] = np.arctan2(along_u[:, 0] * turn, -along_u[:, 1] * turn)
    state[:, 4] = 1.0
    state[:, 6] = 1.0
    return state


def _model(windows: Windows, state: Floats) -> tuple[Floats, Floats]:
    """Residuals (n, p) and partials (n, p, parameters) of the grey levels."""
    centre, angles = state[:, None, :2], state[:, 2:4]
    blur, half = state[:, 4, None], state[:, 6, None]
    place = windows.offsets_px[None] - centre
    distances, by_centre, by_angle, by_bow = [], [], [], []
    for k in range(2):
        cos, sin = np.cos(angles[:, k, None]), np.sin(angles[:, k, None])
        bow = state[:, 9 + k, None]
        across = cos * place[..., 0] + sin * place[..., 1]
        along = -sin * place[..., 0] + cos * place[..., 1]
        distances.append((across - bow * along**2) / blur)
        slope = 2.0 * bow * along
        by_centre.append(np.stack([-cos - slope * sin, -sin + slope * cos], axis=-1))
        by_angle.append(along + slope * across)
        by_bow.append(-(along**2))
    correlation = np.cos(angles[:, 0] - angles[:, 1])[:, None]
    value, by_h, by_k, by_r = crossed_edges(distances[0], distances[1], correlation)
    slope_1, slope_2 = half * by_h / blur, half * by_k / blur
    turn = half * by_r * np.sin(angles[:, 0] - angles[:, 1])[:, None]
    partials = np.empty((*value.shape, PARAMETERS))
    partials[..., :2] = slope_1[..., None] * by_centre[0] + slope_2[..., None] * by_centre[1]
    partials[..., 2] = slope_1 * by_angle[0] - turn
    partials[..., 3] = slope_2 * by_angle[1] + turn
    partials[..., 4] = -(slope_1 * distances[0] + slope_2 * distances[1])
    partials[..., 5] = 1.0
    partials[..., 6] = value
    partials[..., 7:9] = place
    partials[..., 9] = slope_1 * by_bow[0]
    partials[..., 10] = slope_2 * by_bow[1]
    plane = state[:, 5, None] + np.einsum("npi,ni->np", place, state[:, 7:9])
    return windows.values - (plane + half * value), partials


def crossed_edges(
    h: Floats, k: Floats, correlation: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Mean of sign(h + a) sign(k + b) over normal a, b of unit variance, and its derivatives.

    ``h``, ``k`` (n, p) are distances to the two edges in units of the blur, ``correlation``
    (n, 1) the cosine between their normals. Returns value, d/dh, d/dk, d/dcorrelation, (n, p).
    """
    root2 = np.sqrt(2.0)
    bounded = np.clip(correlation, -0.98, 0.98)
    rest = np.sqrt(1.0 - bounded**2)
    value = erf(h / root2) * erf(k / root2)
    hh, hk = h * h + k * k, h * k
    for node, weight in zip((_NODES + 1.0) / 2.0, _WEIGHTS / 2.0, strict=True):
        value = value + weight * bounded * _density(hh, hk, bounded * node)
    by_h = np.sqrt(2.0 / np.pi) * np.exp(-h * h / 2.0) * erf((k - bounded * h) / (rest * root2))
    by_k = np.sqrt(2.0 / np.pi) * np.exp(-k * k / 2.0) * erf((h - bounded * k) / (rest * root2))
    return value, by_h, by_k, _density(hh, hk, bounded)


def _density(hh: Floats, hk: Floats, r: Floats) -> Floats:
    """Four times the density of the bivariate normal."""
    rest = 1.0 - r * r
    return np.asarray(2.0 / (np.pi * np.sqrt(rest)) * np.exp((2.0 * r * hk - hh) / (2.0 * rest)))


def _linear_start(state: Floats, values: Floats, weight: Floats, partials: Floats) -> Floats:
    """Mean and contrast of the first guess, both linear."""
    linear = partials[..., 5:7]
    normal = np.einsum("npi,np,npj->nij", linear, weight, linear)
    right = np.einsum("npi,np,np->ni", linear, weight, values)
    state = state.copy()
    state[:, 5:7] = _solve(normal + 1e-9 * np.eye(2), right)
    return state


def _normal_equations(
    residual: Floats, partials: Floats, weight: Floats, state: Floats
) -> tuple[Floats, Floats, Floats]:
    """Normal matrices, right sides and the rms residual of each window."""
    weighted = partials * weight[..., None]
    normal = weighted.transpose(0, 2, 1) @ partials
    right = np.einsum("npi,np->ni", weighted, residual)
    freedom = np.maximum(weight.sum(axis=1) - PARAMETERS, 1.0)
    noise = np.sqrt((weight * residual**2).sum(axis=1) / freedom)
    prior = noise**2 / BOW_SIGMA**2
    for k in (9, 10):
        normal[:, k, k] += prior
        right[:, k] -= prior * state[:, k]
    diagonal = np.einsum("nii->ni", normal)
    diagonal += 1e-9 * np.maximum(diagonal, 1e-12) + 1e-12
    return normal, right, noise


def _inverse(matrices: Floats) -> Floats:
    good = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    safe = np.where(good[:, None, None], matrices, np.eye(matrices.shape[1]))
    return np.asarray(np.linalg.inv(safe))


def _solve(normal: Floats, right: Floats) -> Floats:
    return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0])
