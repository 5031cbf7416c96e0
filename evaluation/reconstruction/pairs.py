"""Which cameras match with which: decided by the angle between their rays to the subject."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evaluation.reconstruction.views import View
from evaluation.reconstruction.volume import Volume
from geometry.arrays import Floats

BEST_DEG = 14.0
"""Semi-global matching finds most between 10 and 18 degrees: nearer pairs are noisy, farther ones
look too different."""

NEAREST_DEG = 1.0
"""Below, the rays of two cameras are parallel as far as depth is concerned."""


def ray_angles_deg(views: Sequence[View], volume: Volume) -> Floats:
    """Angle between the rays of each two cameras to the middle of the subject, (n, n)."""
    rays = np.array([v.pose.position_rig_mm - volume.centre_rig_mm for v in views])
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return np.asarray(np.degrees(np.arccos(np.clip(rays @ rays.T, -1.0, 1.0))))


def pixel_ratios(views: Sequence[View], volume: Volume) -> Floats:
    """Larger over smaller pixel of each two cameras in the middle of the subject, (n, n)."""
    away = [np.linalg.norm(v.pose.position_rig_mm - volume.centre_rig_mm) for v in views]
    sizes = np.array([d / v.matrix[0, 0] for d, v in zip(away, views, strict=True)])
    ratio = sizes[:, None] / sizes
    return np.asarray(np.maximum(ratio, 1.0 / ratio))


def _within(row_deg: Floats, reference: int, farthest_deg: float) -> list[int]:
    return [k for k, a in enumerate(row_deg) if k != reference and NEAREST_DEG <= a <= farthest_deg]


def partners(angles_deg: Floats, reference: int, most: int, farthest_deg: float) -> tuple[int, ...]:
    """The cameras best paired with ``reference`` for coarse depth, best first."""
    row = angles_deg[reference]
    others = _within(row, reference, farthest_deg)
    return tuple(sorted(others, key=lambda k: abs(np.log(row[k] / BEST_DEG)))[:most])


def companions(
    angles_deg: Floats, reference: int, most: int, farthest_deg: float
) -> tuple[int, ...]:
    """The cameras that refine points of ``reference``: the nearest within the limit."""
    row = angles_deg[reference]
    others = _within(row, reference, farthest_deg)
    return tuple(sorted(others, key=lambda k: row[k])[:most])
