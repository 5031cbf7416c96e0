"""Visibility cuts: planes above which a camera sees past what hides a point assigned to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats, Ints
from solver.coverage.assignment import AssignedViews
from solver.coverage.views import centres_mm
from solver.coverage.visibility import tangent_planes
from solver.problem import Problem
from solver.variables import NetworkState


@dataclass(frozen=True, eq=False)
class VisibilityCuts:
    """Visibility cuts that cameras must stay above to see points they were assigned.

    ``camera`` and ``point`` (m,) name the ray; ``plane_point`` and ``normal`` (m, 3) the plane, in
    the solver's units.
    """

    camera: Ints
    point: Ints
    plane_point: Floats
    normal: Floats

    @classmethod
    def none(cls) -> VisibilityCuts:
        """No cuts."""
        empty = np.zeros(0, dtype=np.int64)
        return cls(empty, empty, np.zeros((0, 3)), np.zeros((0, 3)))

    def joined(self, other: VisibilityCuts) -> VisibilityCuts:
        """These cuts and the others."""
        return VisibilityCuts(
            np.concatenate([self.camera, other.camera]),
            np.concatenate([self.point, other.point]),
            np.concatenate([self.plane_point, other.plane_point]),
            np.concatenate([self.normal, other.normal]),
        )

    def of(self, assigned: AssignedViews) -> VisibilityCuts:
        """The cuts of rays that are still assigned."""
        stride = 1 + int(max(self.point.max(initial=0), assigned.point.max(initial=0)))
        keep = np.isin(self.camera * stride + self.point, assigned.camera * stride + assigned.point)
        return VisibilityCuts(
            self.camera[keep], self.point[keep], self.plane_point[keep], self.normal[keep]
        )


def cuts_for_hidden(
    problem: Problem, state: NetworkState, assigned: AssignedViews, open_mm: Floats
) -> VisibilityCuts:
    """Cuts for the assigned rays that something hides at ``state``, in every head position.

    ``open_mm`` (m, 3) are directions of the rig frame in which each assigned point is visible.
    """
    source, occluder = problem.subject.design_points, problem.subject.occluder
    points, normals = source.points_mm[assigned.point], source.normals[assigned.point]
    eyes = centres_mm(problem, state)[assigned.camera]
    cuts = VisibilityCuts.none()
    for position in problem.visibility_positions:
        local = position.eye_seen_by_head(eyes)
        rows = np.flatnonzero(occluder.hidden(points, normals, local))
        if len(rows) == 0:
            continue
        found = tangent_planes(
            source, occluder, assigned.point[rows], local[rows], open_mm[rows] @ position.rotation
        )
        plane_point = problem.scaled(position.points(found.point_mm))
        normal = position.directions(found.normal)
        cuts = cuts.joined(
            VisibilityCuts(assigned.camera[rows], assigned.point[rows], plane_point, normal)
        )
    return cuts


def opening_directions(problem: Problem, state: NetworkState, assigned: AssignedViews) -> Floats:
    """Directions (m, 3) in which assigned points can be seen: today's ray, or else the normal."""
    source = problem.subject.design_points
    ray = centres_mm(problem, state)[assigned.camera] - source.points_mm[assigned.point]
    return np.where(assigned.kept[:, None], ray, source.normals[assigned.point])
