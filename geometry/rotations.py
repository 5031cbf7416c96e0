"""Rotation matrices as people write them into files."""

from __future__ import annotations

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats

EXACT = 1e-9
"""Up to here a matrix is taken to the last bit, so that files round-trip."""

ROUNDED = 2e-3
"""Up to here a matrix counts as a rotation written with few digits: with three of them a product of
rows is off by at most 2 * sqrt(3) * 0.0005 = 0.0017."""


def nearest_rotation(matrix: Floats) -> Floats:
    """The rotation (3, 3) that ``matrix`` (3, 3) stands for.

    A matrix written with three digits or more is replaced by the nearest rotation (polar
    decomposition); anything further off is an :class:`InputError`.
    """
    off = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if off > ROUNDED or np.linalg.det(matrix) < 0.0:
        raise InputError(
            "pose-not-a-rotation",
            f"rotation_rig_to_camera is not a rotation (its rows are off by {off:.2g})",
            "give three unit rows at right angles with determinant +1",
        )
    if off <= EXACT:
        return matrix
    u, _, vt = np.linalg.svd(matrix)
    return np.asarray(u @ vt)
