"""Where the subject is, as far as the cameras alone tell: what they all look at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from evaluation.reconstruction.views import View
from geometry.arrays import Floats, frozen


@dataclass(frozen=True, eq=False)
class Volume:
    """A ball that holds the subject: ``centre_rig_mm`` (3,) and ``radius_mm``."""

    centre_rig_mm: Floats
    radius_mm: float

    def __post_init__(self) -> None:
        centre = frozen(self.centre_rig_mm)
        if centre.shape != (3,) or not np.isfinite(centre).all() or not self.radius_mm > 0.0:
            raise InputError(
                "volume", "the volume of a subject needs a centre and a radius", "give both in mm"
            )
        object.__setattr__(self, "centre_rig_mm", centre)


def common_volume(views: Sequence[View]) -> Volume:
    """The point nearest to all optical axes, and how far about it most pictures reach.

    Least squares: the sum of squared distances to the axes is least. Raises
    :class:`InputError` where the axes do not meet (all parallel).
    """
    centres = np.array([v.pose.position_rig_mm for v in views])
    axes = np.array([v.pose.rotation_rig_to_camera[2] for v in views])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    normal = across.sum(axis=0)
    if np.linalg.cond(normal) > 1e6:
        raise InputError(
            "volume-parallel",
            "the cameras look in parallel, so where the subject is cannot be told",
            "give the subject's place (--centre) or its design",
        )
    centre = np.linalg.solve(normal, np.einsum("nij,nj->i", across, centres))
    distance = np.linalg.norm(centre - centres, axis=1)
    half = np.array([max(v.size_px) / 2.0 / v.matrix[0, 0] for v in views])
    return Volume(centre, float(np.median(distance * half)))
