"""Candidate constraints of coverage: incidence of assigned views, cuts, what stays hidden."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats, Ints
from solver.constraints.base import bound
from solver.constraints.candidates import CandidateConstraints, grouped
from solver.constraints.positions import PositionCones
from solver.coverage.assignment import AssignedViews
from solver.coverage.cuts import VisibilityCuts
from solver.coverage.hidden import KeptHidden
from solver.problem import Problem
from solver.variables import NetworkState

_CUT_MARGIN = float(np.sin(np.radians(0.3)))
"""A camera stays this far above a visibility cut: ray casting against facets is no more exact."""


def assigned_view_constraints(
    problem: Problem, assigned: AssignedViews, margin_deg: float
) -> list[CandidateConstraints]:
    """Incidence of every assigned ray, in every head position, (m,) rows."""
    if len(assigned.point) == 0:
        return []
    scale = problem.length_mm
    opening = np.cos(np.radians(problem.limits.incidence.ray_max_deg - margin_deg))
    source = problem.subject.design_points
    points, normals = source.points_mm[assigned.point], source.normals[assigned.point]
    positions = problem.visibility_positions
    point = np.concatenate([problem.scaled(p.points(points)) for p in positions])
    normal = np.concatenate([p.directions(normals) for p in positions])
    camera = np.tile(assigned.camera, len(positions))
    block = PositionCones(
        "coverage",
        "mm",
        scale,
        bound(0.0, camera),
        bound(np.inf, camera),
        camera,
        point,
        normal,
        bound(opening, camera),
    )
    return [CandidateConstraints(block, grouped(camera), 12)]


def cut_constraints(
    problem: Problem, cuts: VisibilityCuts, state: NetworkState | None = None
) -> list[CandidateConstraints]:
    """The cuts as rows, all of them worked on.

    A camera that stands nearer to a cut than it should, at ``state``, comes no nearer.
    """
    if len(cuts.camera) == 0:
        return []
    margin = bound(_CUT_MARGIN, cuts.camera)
    if state is not None:
        margin = np.minimum(margin, _cosine(state, cuts.camera, cuts.plane_point, cuts.normal))
    block = PositionCones(
        "coverage",
        "mm",
        problem.length_mm,
        bound(0.0, cuts.camera),
        bound(np.inf, cuts.camera),
        cuts.camera,
        cuts.plane_point,
        cuts.normal,
        margin,
    )
    return [CandidateConstraints.all_of(block)]


def hidden_constraints(
    problem: Problem, kept: KeptHidden, state: NetworkState
) -> list[CandidateConstraints]:
    """What is kept hidden as rows that hold at ``state``, all of them worked on."""
    if len(kept.camera) == 0:
        return []
    here = _cosine(state, kept.camera, kept.tip, kept.axis)
    block = PositionCones(
        "coverage",
        "mm",
        problem.length_mm,
        bound(-np.inf, kept.camera),
        bound(0.0, kept.camera),
        kept.camera,
        kept.tip,
        kept.axis,
        np.maximum(kept.opening, here),
    )
    return [CandidateConstraints.all_of(block)]


def _cosine(state: NetworkState, camera: Ints, tip: Floats, axis: Floats) -> Floats:
    """Cosine (m,) of the angle at which cameras stand about an axis (m, 3) through a tip (m, 3)."""
    away = state.centre[camera] - tip
    return np.asarray(np.einsum("mk,mk->m", away, axis) / np.linalg.norm(away, axis=1))
