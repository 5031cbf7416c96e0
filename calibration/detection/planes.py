"""Homographies of many small sets of points at once."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from geometry.arrays import Bools, Floats


def homographies(plane: Floats, pixels: Floats) -> Floats:
    """Least-squares homographies (m, 3, 3) of plane (m, k, 2) to pixels (m, k, 2), k >= 4.

    Both sides are centred and scaled first; a set without an answer gives NaN.
    """
    to_plane, plane_n = _normalised(plane)
    to_pixels, pixels_n = _normalised(pixels)
    x, y = plane_n[..., 0], plane_n[..., 1]
    u, v = pixels_n[..., 0], pixels_n[..., 1]
    one, zero = np.ones_like(x), np.zeros_like(x)
    rows = np.concatenate(
        [
            np.stack([x, y, one, zero, zero, zero, -u * x, -u * y], axis=-1),
            np.stack([zero, zero, zero, x, y, one, -v * x, -v * y], axis=-1),
        ],
        axis=1,
    )
    right = np.concatenate([u, v], axis=1)
    normal = rows.transpose(0, 2, 1) @ rows
    good = np.linalg.cond(normal) < 1e11
    safe = np.where(good[:, None, None], normal, np.eye(8))
    answer = np.linalg.solve(safe, (rows.transpose(0, 2, 1) @ right[..., None]))[..., 0]
    matrix = np.concatenate([answer, np.ones((len(answer), 1))], axis=1).reshape(-1, 3, 3)
    matrix = np.linalg.inv(to_pixels) @ matrix @ to_plane
    matrix[~good] = np.nan
    return np.asarray(matrix)


def _normalised(points: Floats) -> tuple[Floats, Floats]:
    middle = points.mean(axis=1)
    away = points - middle[:, None]
    scale = 1.0 / np.maximum(np.abs(away).max(axis=(1, 2)), 1e-12)
    matrix = np.zeros((len(points), 3, 3))
    matrix[:, 0, 0] = matrix[:, 1, 1] = scale
    matrix[:, :2, 2] = -middle * scale[:, None]
    matrix[:, 2, 2] = 1.0
    return matrix, away * scale[:, None, None]


def mapped(matrix: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Pixels (m, 2) of one place each (m, 2), and the Jacobians (m, 2, 2) there."""
    ends = np.einsum("mij,mj->mi", matrix, np.column_stack([places, np.ones(len(places))]))
    pixel = ends[:, :2] / ends[:, 2:]
    slope = matrix[:, :2, :2] - pixel[:, :, None] * matrix[:, 2:, :2]
    return pixel, slope / ends[:, 2:, None]


LEAST_TO_STRAIGHTEN = 10
BENDS = np.linspace(-0.9, 0.5, 29)
BETTER = 0.5


def straightened(plane: Floats, pixels: Floats, size_px: tuple[int, int]) -> Floats:
    """Pixels (n, 2) of points of a plane (n, 2) as a lens without distortion would image them.

    Two radial terms about the middle of the picture (the division model of Fitzgibbon 2001),
    which wide lenses obey nearly; they are chosen by how well a homography fits then, and left out
    where they do not halve what is left.
    """
    middle = (np.array(size_px) - 1.0) / 2.0
    away = pixels - middle
    squares = np.sum(away**2, axis=1) / np.sum(middle**2)
    if len(plane) < LEAST_TO_STRAIGHTEN:
        return pixels
    costs = [_bent_cost(plane, away, 1.0 + bend * squares) for bend in BENDS]
    best, step = float(BENDS[int(np.argmin(costs))]), float(BENDS[1] - BENDS[0])
    near = best + step * np.linspace(-1.0, 1.0, 11)
    fine = [_bent_cost(plane, away, 1.0 + bend * squares) for bend in near]
    bend = float(near[int(np.argmin(fine))])
    if min(fine) > BETTER * _bent_cost(plane, away, np.ones(len(away))):
        return pixels

    def cost(bends: Floats) -> float:
        return _bent_cost(plane, away, 1.0 + bends[0] * squares + bends[1] * squares**2)

    # One term alone leaves a pixel or two where the widest lenses see most aslant.
    begin = np.array([[bend, 0.0], [bend + 0.1, -0.1], [bend, 0.1]])
    both = minimize(
        cost,
        begin[0],
        method="Nelder-Mead",
        options={"maxfev": 120, "initial_simplex": begin},
    ).x
    return np.asarray(middle + away / (1.0 + both[0] * squares + both[1] * squares**2)[:, None])


def _bent_cost(plane: Floats, away: Floats, share: Floats) -> float:
    """What a homography leaves, median in pixels of the picture as it is."""
    if share.min() < 0.05:
        return float("inf")
    straight, used = away / share[:, None], np.ones(len(away), dtype=bool)
    off = np.zeros(len(away))
    for _ in range(2):
        matrix = homographies(plane[None, used], straight[None, used])
        guess, _ = mapped(np.repeat(matrix, len(plane), axis=0), plane)
        off = np.linalg.norm(guess - straight, axis=1) * share
        # A few points out of their places must not choose the lens.
        used = off <= np.quantile(off, 0.8)
    return float(np.median(off))


def grown(places: Floats, pixels: Floats, good: Bools, limit_px: float) -> Bools:
    """More points (n,) that go on where the ``good`` ones lead, however the lens bends the plane.

    Polynomials of the places (n, 2), second order and third where there are points enough.
    """
    span = np.ptp(places, axis=0).max()
    x, y = ((places - places.mean(axis=0)) / span).T
    terms = [np.ones_like(x), x, y, x * x, x * y, y * y]
    third = [x**3, x * x * y, x * y * y, y**3]
    while 12 <= good.sum() < len(good):
        basis = np.stack(terms + (third if good.sum() >= 24 else []), axis=1)
        answer = np.linalg.lstsq(basis[good], pixels[good], rcond=None)[0]
        off = np.linalg.norm(basis @ answer - pixels, axis=1)
        more = good | (off < limit_px)
        if (more == good).all():
            break
        good = more
    return good


def neighbour_residuals(plane: Floats, pixels: Floats, count: int = 12) -> Floats:
    """How far each of n points is from where its neighbours say, (n,) pixels.

    The homography is that of the nearest ``count`` others, so lens distortion hardly matters.
    NaN where they stand in one line or are fewer than six.
    """
    count = min(count, len(plane) - 1)
    if count < 6:
        return np.full(len(plane), np.nan)
    away = np.linalg.norm(plane[:, None] - plane[None], axis=2)
    nearest = np.argsort(away, axis=1, kind="stable")[:, 1 : count + 1]
    matrix = homographies(plane[nearest], pixels[nearest])
    guess, _ = mapped(matrix, plane)
    return np.asarray(np.linalg.norm(guess - pixels, axis=1))
