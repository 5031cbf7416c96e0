"""Places of a surface that may be a nose tip, and ways the face may point there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.spatial import cKDTree

from geometry.arrays import Floats, Ints

BALL_MM = 26.0
"""A nose, whole, fits into a ball of this radius about its tip."""

_APART_MM = 12.0
_LEAST_ROUND = 0.12


@dataclass(frozen=True, eq=False)
class Peaks:
    """Places that stand out: ``points_mm`` (n, 3), unit ``directions`` (n, 3), ``index`` (n,)."""

    points_mm: Floats
    directions: Floats
    index: Ints


def stand_out(points_mm: Floats) -> tuple[Floats, Floats]:
    """How far points (n, 3) stand out of the surface about them: vectors (n, 3), roundness (n,).

    The vector goes from the centroid of the surface within :data:`BALL_MM` to the point; it
    turns with the surface and needs no normals. Roundness is the spread of that surface across
    the vector, least over greatest: an edge of the scan, which stands out sideways, has next to
    none.
    """
    pairs = cKDTree(points_mm).query_pairs(BALL_MM, output_type="ndarray")
    own = np.arange(len(points_mm))
    row = np.concatenate([pairs[:, 0], pairs[:, 1], own])
    column = np.concatenate([pairs[:, 1], pairs[:, 0], own])
    share = 1.0 / np.bincount(row)
    mean = coo_array((share[row], (row, column)), (len(own), len(own))).tocsr()
    centre = mean @ points_mm
    out = points_mm - centre
    square = mean @ (points_mm[:, :, None] * points_mm[:, None, :]).reshape(-1, 9)
    spread = square.reshape(-1, 3, 3) - centre[:, :, None] * centre[:, None, :]
    unit = out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)
    across = np.eye(3) - unit[:, :, None] * unit[:, None, :]
    values = np.linalg.eigvalsh(across @ spread @ across)
    return out, np.sqrt(np.maximum(values[:, 1], 0.0) / np.maximum(values[:, 2], 1e-9))


def peaks(points_mm: Floats, most: int) -> Peaks:
    """The ``most`` places of an evenly sampled surface (n, 3) that stand out farthest."""
    out, round_ = stand_out(points_mm)
    height = np.where(round_ > _LEAST_ROUND, np.linalg.norm(out, axis=1), 0.0)
    order = np.argsort(-height, kind="stable")
    tree, taken = cKDTree(points_mm), np.zeros(len(points_mm), dtype=bool)
    chosen: list[int] = []
    for k in order:
        if len(chosen) == most or height[k] <= 0.0:
            break
        if not taken[k]:
            chosen.append(int(k))
            taken[tree.query_ball_point(points_mm[k], _APART_MM)] = True
    picked = np.array(chosen, dtype=np.int64)
    unit = out[picked] / np.maximum(height[picked, None], 1e-9)
    return Peaks(points_mm[picked], unit, picked)
