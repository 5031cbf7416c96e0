"""Homographies of many small sets of points at once."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats


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
