"""The subject: what is photographed, ready for a design."""

from __future__ import annotations

from dataclasses import dataclass

from geometry.raycast import Occluder
from geometry.surface import SurfacePoints


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
