"""Small rotations: matrices from rotation vectors and back, for many at once."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats


def cross_matrix(vectors: Floats) -> Floats:
    """Matrices (..., 3, 3) with ``cross_matrix(a) @ b = a x b`` of vectors (..., 3)."""
    out = np.zeros((*vectors.shape, 3))
    out[..., 0, 1], out[..., 0, 2] = -vectors[..., 2], vectors[..., 1]
    out[..., 1, 0], out[..., 1, 2] = vectors[..., 2], -vectors[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -vectors[..., 1], vectors[..., 0]
    return out


def rotation_of(vectors_rad: Floats) -> Floats:
    """Rotations (..., 3, 3) about ``vectors_rad`` (..., 3) by their length (Rodrigues)."""
    angle2 = np.einsum("...i,...i->...", vectors_rad, vectors_rad)
    angle = np.sqrt(angle2)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    # The series is exact to 1e-18 here, where the quotients would lose half their digits.
    first = np.where(small, 1.0 - angle2 / 6.0, np.sin(safe) / safe)
    second = np.where(small, 0.5 - angle2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    k = cross_matrix(vectors_rad)
    return np.asarray(
        np.eye(3) + first[..., None, None] * k + second[..., None, None] * (k @ k), np.float64
    )


def vector_of(rotations: Floats) -> Floats:
    """Rotation vectors (..., 3) in radians of rotations (..., 3, 3), lengths up to pi."""
    skew = np.stack(
        [
            rotations[..., 2, 1] - rotations[..., 1, 2],
            rotations[..., 0, 2] - rotations[..., 2, 0],
            rotations[..., 1, 0] - rotations[..., 0, 1],
        ],
        axis=-1,
    )
    sine = 0.5 * np.linalg.norm(skew, axis=-1)
    cosine = 0.5 * (np.trace(rotations, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(sine, cosine)
    factor = np.where(sine > 1e-9, angle / np.where(sine > 1e-9, 2.0 * sine, 1.0), 0.5)
    return np.asarray(factor[..., None] * skew)


def nearest_rotation(matrix: Floats) -> Floats:
    """The proper rotation (3, 3) nearest to ``matrix`` (3, 3) in the Frobenius norm."""
    u, _, vt = np.linalg.svd(matrix)
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    return np.asarray(u @ flip @ vt)


def similarity(
    source: Floats, target: Floats, scaled: bool = False, weights: Floats | None = None
) -> tuple[float, Floats, Floats]:
    """Scale, rotation (3, 3), shift (3,) with ``target ~ scale R source + shift`` (Umeyama).

    ``source``, ``target`` (n, 3), ``weights`` (n,). Without ``scaled`` the scale is 1. Of two
    points the turn about their line is arbitrary.
    """
    w = np.full(len(source), 1.0 / len(source)) if weights is None else weights / weights.sum()
    a, b = w @ source, w @ target
    p, q = source - a, target - b
    rotation = nearest_rotation((w[:, None] * q).T @ p)
    scale = 1.0
    if scaled:
        scale = float(np.sum(w[:, None] * q * (p @ rotation.T)) / np.sum(w[:, None] * p * p))
    return scale, rotation, b - scale * rotation @ a
