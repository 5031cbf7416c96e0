"""Distance between convex bodies given by their corners."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls
from scipy.spatial import ConvexHull, QhullError

from geometry.arrays import Floats

ROUND_SIDES = 48
"""Sides of the prism that stands for a round lens. It is circumscribed, so a clearance is
never overstated; it is understated by at most r (1/cos(pi/48) - 1), 0.03 mm at r = 15 mm."""


def box_corners(size_mm: Floats, centre_mm: Floats) -> Floats:
    """The 8 corners of an upright box, (8, 3)."""
    signs = np.array(
        [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64
    )
    return np.asarray(centre_mm + signs * np.asarray(size_mm) / 2.0)


def cylinder_corners(diameter_mm: float, near_z_mm: float, far_z_mm: float) -> Floats:
    """Corners (2 ROUND_SIDES, 3) of the prism about a cylinder along z."""
    turn = 2.0 * np.pi * (np.arange(ROUND_SIDES) + 0.5) / ROUND_SIDES
    radius = diameter_mm / 2.0 / np.cos(np.pi / ROUND_SIDES)
    ring = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.zeros(ROUND_SIDES)], axis=1)
    along = np.array([0.0, 0.0, 1.0])
    return np.concatenate([ring + near_z_mm * along, ring + far_z_mm * along])


def signed_distance(one: Floats, other: Floats) -> float:
    """Gap between the convex hulls of two sets of corners (N, 3) and (M, 3), in their unit.

    Negative when the hulls overlap: then it is the shortest way apart. The gap is the norm of
    the shortest vector in the hull of all differences. Finding it is a least squares problem
    with non-negative weights: minimise |P u|^2 + (1 - sum u)^2, whose optimum has the same
    direction as the one with weights that sum to 1.
    """
    differences = (one[:, None, :] - other[None, :, :]).reshape(-1, 3)
    scale = float(np.abs(differences).max())
    if scale == 0.0:
        return 0.0
    system = np.vstack([differences.T / scale, np.ones(len(differences))])
    weights, _ = nnls(system, np.array([0.0, 0.0, 0.0, 1.0]))
    nearest = differences.T @ (weights / weights.sum())
    gap = float(np.linalg.norm(nearest))
    if gap > 1e-9 * scale:
        return gap
    return -_depth(differences)


def _depth(differences: Floats) -> float:
    """How far the origin lies inside the hull of ``differences`` (K, 3)."""
    try:
        hull = ConvexHull(differences)
    except QhullError:
        # Two flat things that touch have a flat hull of differences: they touch, no more.
        return 0.0
    return float(max(0.0, -hull.equations[:, 3].max()))
