"""Points nearest to bundles of rays, for many points at once."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats, Ints

LEAST_ANGLE_RAD = 1e-4
"""Rays that meet at less than this (radians, about) say nothing of the depth."""


def nearest_points(
    origins: Floats, directions: Floats, group: Ints, count: int, weights: Floats | None = None
) -> Floats:
    """Points (count, 3) nearest to rays (n, 3) + (n, 3) of each ``group`` (n,).

    NaN for groups with fewer than two rays, or rays that are all but parallel.
    """
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    if weights is not None:
        across *= weights[:, None, None]
    matrix = _sums(across.reshape(-1, 9), group, count).reshape(-1, 3, 3)
    right = _sums(np.einsum("nij,nj->ni", across, origins), group, count)
    rays = np.bincount(group, minlength=count)
    sizes = np.linalg.eigvalsh(matrix)
    good = (rays >= 2) & (sizes[:, 0] > LEAST_ANGLE_RAD**2 * np.maximum(sizes[:, 2], 1e-300))
    points = np.full((count, 3), np.nan)
    points[good] = np.linalg.solve(matrix[good], right[good][:, :, None])[:, :, 0]
    return points


def _sums(values: Floats, group: Ints, count: int) -> Floats:
    columns = [np.bincount(group, values[:, k], minlength=count) for k in range(values.shape[1])]
    return np.stack(columns, axis=1)
