"""What a mount has to keep clear of, and where it stands."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.subject import Subject
from rig.build.mounts.shapes import ConvexShape
from rig.solids.convex import box_corners
from rig.solids.sight import seen_by, view_corners
from solver.limits import Limits

HEAD_ENTRY = "head entry"
SEAT_HEIGHT_MM = 1200.0
"""Height of a sitting person's nose over the floor, 50th percentile of adults, to 50 mm."""


@dataclass(frozen=True, eq=False)
class Zone:
    """A box ``low_mm`` (3,) to ``high_mm`` (3,) of the rig frame that stays free."""

    name: str
    low_mm: Floats
    high_mm: Floats

    @cached_property
    def shape(self) -> ConvexShape:
        """The box as a solid."""
        low, high = np.asarray(self.low_mm), np.asarray(self.high_mm)
        return ConvexShape(box_corners(high - low, (low + high) / 2.0))


def head_entry(subject: Subject, floor_z_mm: float) -> Zone:
    """Room for a person to sit down: from the face backwards, from the floor to over the head.

    The head with 150 mm on each side and above, 20 mm before the nose, and a metre behind it.
    """
    vertices = subject.occluder.vertices_mm
    points = vertices if len(vertices) else subject.check_points.points_mm
    low, high = points.min(axis=0), points.max(axis=0)
    return Zone(
        HEAD_ENTRY,
        np.array([low[0] - 150.0, low[1] - 20.0, min(floor_z_mm, low[2] - 1.0)]),
        np.array([high[0] + 150.0, high[1] + 1000.0, high[2] + 150.0]),
    )


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Subject, limits, zones and the floor. ``clearance_mm``: least gap between solids.

    ``standing`` cameras are there already and stay.
    """

    subject: Subject
    limits: Limits
    zones: tuple[Zone, ...]
    floor_z_mm: float
    clearance_mm: float
    standing: tuple[RigCamera, ...] = ()

    @cached_property
    def datum_mm(self) -> Floats:
        """The foremost point of the subject (3,), from which a builder measures."""
        return self.subject.foremost_mm

    @cached_property
    def centroid_mm(self) -> Floats:
        """What the cameras are aimed at, (3,)."""
        return self.subject.design_points.centroid_mm

    @property
    def view_clearance_mm(self) -> float:
        """How far solids keep from a camera's view."""
        return self.limits.sight_line_clearance_mm or 0.0

    def view(self, camera: RigCamera) -> ConvexShape | None:
        """The volume between a camera and what it sees; None when it sees nothing."""
        points = self.subject.check_points
        seen = seen_by(camera, points, self.subject.occluder, self.limits.incidence.ray_max_deg)
        if not seen.any():
            return None
        return ConvexShape(view_corners(camera, points.points_mm[seen]))
