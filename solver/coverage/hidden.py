"""Points that stay hidden: a camera that would see them would have to have them in focus."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from solver.coverage.views import centres_mm
from solver.coverage.visibility import cosines_of, tangent_planes
from solver.problem import Problem
from solver.variables import NetworkState

_BELOW = 1e-3
"""Sine of the angle by which a camera stays below the plane over which a point comes into view: ray
casting finds that plane to a few hundredths of a degree."""

_BEYOND = 1e-6
"""Cosine by which a ray stays beyond the limit of incidence, so that rounding brings no view."""


@dataclass(frozen=True, eq=False)
class KeptHidden:
    """Check points that cameras must not come to see, as cones about directions.

    ``camera`` and ``point`` (m,) name the ray; ``tip`` (m, 3), in the solver's units, ``axis``
    (m, 3) and the cosine ``opening`` (m,) the cone that the camera stays out of.
    """

    camera: Ints
    point: Ints
    tip: Floats
    axis: Floats
    opening: Floats

    @classmethod
    def none(cls) -> KeptHidden:
        """Nothing is kept hidden."""
        empty, flat = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        return cls(empty, empty, flat, flat, np.zeros(0))

    def joined(self, other: KeptHidden) -> KeptHidden:
        """These and the others."""
        return KeptHidden(
            np.concatenate([self.camera, other.camera]),
            np.concatenate([self.point, other.point]),
            np.concatenate([self.tip, other.tip]),
            np.concatenate([self.axis, other.axis]),
            np.concatenate([self.opening, other.opening]),
        )

    def but(self, seen: Bools) -> KeptHidden:
        """Those of them that the cameras do not see; ``seen`` (n, q) of the check points."""
        keep = ~seen[self.camera, self.point]
        return KeptHidden(
            self.camera[keep], self.point[keep], self.tip[keep], self.axis[keep], self.opening[keep]
        )


def kept_hidden(
    problem: Problem, before: NetworkState, after: NetworkState, camera: Ints, point: Ints
) -> KeptHidden:
    """Cones that keep check points ``point`` (m,) as hidden from cameras (m,) as they were.

    They come into view on the way from ``before`` to ``after``, in one of the head's positions
    at least: by their incidence, or over what hid them.
    """
    source, occluder = problem.subject.check_points, problem.subject.occluder
    limit = float(np.cos(np.radians(problem.limits.incidence.ray_max_deg)))
    out = KeptHidden.none()
    for position in problem.visibility_positions:
        was = position.eye_seen_by_head(centres_mm(problem, before)[camera])
        now = position.eye_seen_by_head(centres_mm(problem, after)[camera])
        at, normal = source.points_mm[point], source.normals[point]
        came = (cosines_of(at, normal, now) >= limit) & ~occluder.hidden(at, normal, now)
        steep = cosines_of(at, normal, was) < limit
        axis, opening = normal.copy(), np.full(len(point), limit - _BEYOND)
        over = np.flatnonzero(came & ~steep)
        if len(over):
            rays = (now - at)[over]
            axis[over] = tangent_planes(source, occluder, point[over], was[over], rays).normal
            opening[over] = -_BELOW
        tip, axis = problem.scaled(position.points(at)), position.directions(axis)
        some = np.flatnonzero(came)
        out = out.joined(
            KeptHidden(camera[some], point[some], tip[some], axis[some], opening[some])
        )
    return out
