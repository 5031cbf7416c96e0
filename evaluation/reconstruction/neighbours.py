"""The last look at a cloud: points that stand off the surface their neighbours draw."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from geometry.arrays import Bools, Floats

NEAREST = 20
"""Neighbours that draw the surface: fewer make it noisy, more blunt the wings of a nose."""

_AT_ONCE = 100_000


SCATTER = 1.6
"""How much more the neighbours may scatter than their median may stand off: measured on a face,
less cuts the temples away, more keeps the rims of nostrils."""

SIGMAS = 3.0
"""A surface that is seen at a slant is measured worse: its points may stand off as far as that."""


def on_surface(
    points_mm: Floats, normals: Floats, sigma_mm: Floats, limit_mm: float, workers: int = 1
) -> Bools:
    """Which points (N, 3) lie on a surface, (N,).

    The offsets of a point's neighbours along its normal have their median near 0 and scatter
    little: below ``limit_mm`` and 1.6 times that, or three times the point's ``sigma_mm`` (N,)
    where that is more. At the rim of a hole, where patches hang over an edge, and for stray
    points they do not.
    """
    if len(points_mm) <= NEAREST:
        return np.zeros(len(points_mm), dtype=bool)
    tree = cKDTree(points_mm)
    keep = np.empty(len(points_mm), dtype=bool)
    for begin in range(0, len(points_mm), _AT_ONCE):
        part = slice(begin, begin + _AT_ONCE)
        _, near = tree.query(points_mm[part], k=NEAREST, workers=workers)
        offset = np.einsum("nki,ni->nk", points_mm[near] - points_mm[part][:, None], normals[part])
        middle = np.median(offset, axis=1)
        scatter = np.median(np.abs(offset - middle[:, None]), axis=1)
        limit = np.maximum(limit_mm, SIGMAS * sigma_mm[part])
        keep[part] = (np.abs(middle) <= limit) & (scatter <= np.maximum(SCATTER * limit_mm, limit))
    return keep
