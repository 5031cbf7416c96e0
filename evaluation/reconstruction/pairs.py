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

FARTHEST_DEG = 40.0
"""Beyond, skin looks too different for one patch model; nothing is gained by such a view."""


def ray_angles_deg(views: Sequence[View], volume: Volume) -> Floats:
    """Angle between the rays of each two cameras to the middle of the subject, (n, n)."""
    rays = np.array([v.pose.position_rig_mm - volume.centre_rig_mm for v in views])
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return np.asarray(np.degrees(np.arccos(np.clip(rays @ rays.T, -1.0, 1.0))))


def partners(angles_deg: Floats, reference: int, most: int) -> tuple[int, ...]:
    """The cameras best paired with ``reference`` for coarse depth, best first."""
    row = angles_deg[reference]
    others = [k for k in range(len(row)) if k != reference and 1.0 <= row[k] <= FARTHEST_DEG]
    return tuple(sorted(others, key=lambda k: abs(np.log(row[k] / BEST_DEG)))[:most])


def companions(angles_deg: Floats, reference: int, most: int) -> tuple[int, ...]:
    """The cameras that refine points of ``reference``: the nearest within the limit."""
    row = angles_deg[reference]
    others = [k for k in range(len(row)) if k != reference and 1.0 <= row[k] <= FARTHEST_DEG]
    return tuple(sorted(others, key=lambda k: row[k])[:most])
