"""Implicit solids: signed distances of simple shapes and smooth ways to join them.

Every function takes points (N, 3) and gives values (N,), negative inside, in the unit of the
points. They are exact or close to exact near their surface, which is where surfaces are drawn.
"""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats


def ellipsoid(points: Floats, centre: tuple[float, ...], radii: tuple[float, ...]) -> Floats:
    """Distance to an axis-aligned ellipsoid, first order (exact on the surface)."""
    offset = points - np.array(centre)
    scaled = offset / np.array(radii)
    k0 = np.sqrt(np.einsum("ij,ij->i", scaled, scaled))
    scaled /= np.array(radii)
    k1 = np.sqrt(np.einsum("ij,ij->i", scaled, scaled))
    # At the very centre k1 is 0; the smallest radius_mm is then the distance to the surface.
    return np.where(k1 > 1e-12, k0 * (k0 - 1.0) / np.maximum(k1, 1e-12), -min(radii))


def sphere(points: Floats, centre: tuple[float, ...], radius_mm: float) -> Floats:
    """Distance to a sphere."""
    return np.asarray(np.linalg.norm(points - np.array(centre), axis=1) - radius_mm)


def round_cone(
    points: Floats,
    start: tuple[float, ...],
    end: tuple[float, ...],
    start_radius_mm: float,
    end_radius_mm: float,
) -> Floats:
    """Distance to a rod with round ends whose radius_mm changes evenly from start to end."""
    a, axis = np.array(start), np.array(end) - np.array(start)
    offset = points - a
    along = np.clip(offset @ axis / (axis @ axis), 0.0, 1.0)
    gap = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    return np.asarray(gap - (start_radius_mm + (end_radius_mm - start_radius_mm) * along))


def union(a: Floats, b: Floats, blend: float) -> Floats:
    """Both solids, the seam rounded over a width of ``blend``."""
    overlap = np.maximum(blend - np.abs(a - b), 0.0)
    return np.asarray(np.minimum(a, b) - overlap * overlap / (4.0 * blend))


def intersection(a: Floats, b: Floats, blend: float) -> Floats:
    """What the solids share, the seam rounded over a width of ``blend``."""
    return -union(-a, -b, blend)


def difference(a: Floats, b: Floats, blend: float) -> Floats:
    """``a`` without ``b``, the seam rounded over a width of ``blend``."""
    return -union(-a, b, blend)
