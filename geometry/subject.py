"""The subject: what is photographed, ready for a design."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.arrays import Floats, frozen
from geometry.raycast import Occluder
from geometry.surface import SurfacePoints

NOSE_MM = 15.0
"""How far about the foremost point of the region the scan itself is searched for it."""


@dataclass(frozen=True, eq=False)
class Subject:
    """Points to design for, denser points to judge by, and what can stand in the way.

    ``design_points`` steer the optimisation; ``check_points`` (denser, from the same region)
    are only looked at when a network is judged, so that a design cannot fit itself to the few
    points it was given. ``occluder`` holds the whole scan: hair, ears and shoulders hide the
    face although they are not part of the region.
    """

    design_points: SurfacePoints
    check_points: SurfacePoints
    occluder: Occluder

    @cached_property
    def foremost_mm(self) -> Floats:
        """The point of the subject nearest to the cameras' side (least Y), (3,): a nose tip.

        The region's points are means of their voxels, so the scan's own vertices decide.
        """
        points = np.concatenate([self.check_points.points_mm, self.design_points.points_mm])
        first = points[np.argmin(points[:, 1])]
        vertices = self.occluder.vertices_mm
        near = vertices[np.linalg.norm(vertices - first, axis=1) < NOSE_MM]
        return frozen(near[np.argmin(near[:, 1])] if len(near) else first)
