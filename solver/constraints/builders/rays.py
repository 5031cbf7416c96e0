"""Candidate rows about rays: frame, sampling distance, focus, centring."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from solver.constraints.base import Block, bound
from solver.constraints.candidates import CandidateConstraints, grouped
from solver.constraints.rays import FocusRays, MeanAxisIncidence, MeanImageCoordinate, RayPlanes
from solver.problem import Problem
from solver.variables import NetworkState

_INF = np.inf


def _extremes(problem: Problem, framed: Bools) -> tuple[Ints, Floats]:
    """Cameras (m,) and points (m, 3): the corners of what each free camera frames, head moved."""
    cameras, points = [], []
    for i, camera in enumerate(problem.cameras):
        if camera.fixed:
            continue
        corners = problem.hull(framed[i])
        moved = np.concatenate(
            [problem.scaled(p.points(corners)) for p in problem.framing_positions]
        )
        cameras.append(np.full(len(moved), i))
        points.append(moved)
    return np.concatenate(cameras), np.concatenate(points)


def _frame(problem: Problem, camera: Ints, point: Floats) -> list[CandidateConstraints]:
    if problem.limits.frame is None:
        return []
    sides = np.empty((problem.count, 4, 3))
    for i, c in enumerate(problem.cameras):
        sides[i] = frame_normals(c.camera.frame_limits(problem.limits.frame.margin_px))
    count = len(camera)
    side = np.tile(np.arange(4), count)
    camera, point = np.repeat(camera, 4), np.repeat(point, 4, axis=0)
    pixels = problem.cameras[0].camera.focal_length_px
    block = RayPlanes(
        "frame",
        "px",
        pixels,
        bound(-_INF, camera),
        bound(0.0, camera),
        camera,
        point,
        sides[camera, side],
    )
    return [CandidateConstraints(block, grouped(camera, side), 4)]


def frame_normals(limits: Floats) -> Floats:
    """Normals (4, 3) in the camera frame of the sides of a frame given as left, right, top, bottom.

    A point is inside a side when ``normal . p <= 0``; the sides come in the order left, right,
    top, bottom.
    """
    left, right, top, bottom = limits
    return np.array([[-1.0, 0.0, left], [1.0, 0.0, -right], [0.0, -1.0, top], [0.0, 1.0, -bottom]])


def _depths(problem: Problem, camera: Ints, point: Floats) -> list[CandidateConstraints]:
    """Ground sample distance and, without depth of field, the minimum focus distance."""
    gsd, scale = problem.limits.gsd_max_mm, problem.length_mm
    forward = np.tile([0.0, 0.0, 1.0], (len(camera), 1))
    out = []
    if gsd is not None:
        pixels = np.array([c.camera.focal_length_px for c in problem.cameras])
        farthest = gsd * pixels[camera] / scale
        block = RayPlanes(
            "gsd", "mm", scale / pixels[0], bound(-_INF, camera), farthest, camera, point, forward
        )
        out.append(CandidateConstraints(block, grouped(camera), 4))
    if not problem.limits.depth_of_field:
        near = np.array([c.camera.min_focus_distance_mm for c in problem.cameras]) / scale
        block = RayPlanes(
            "min_focus", "mm", scale, near[camera], bound(_INF, camera), camera, point, forward
        )
        out.append(CandidateConstraints(block, grouped(camera), 4))
    return out


def _focus(problem: Problem, camera: Ints, point: Floats) -> list[CandidateConstraints]:
    if not problem.limits.depth_of_field:
        return []
    scale = problem.length_mm
    kinds = [c.camera for c in problem.cameras]
    blur = (
        np.array([c.circle_of_confusion_mm * c.f_number / c.focal_length_mm**2 for c in kinds])
        * scale
    )
    focal = np.array([c.focal_length_mm for c in kinds]) / scale
    both, side = np.repeat(camera, 2), np.tile([1.0, -1.0], len(camera))
    block = FocusRays(
        "depth_of_field",
        "mm",
        scale,
        bound(-_INF, both),
        bound(0.0, both),
        both,
        np.repeat(point, 2, axis=0),
        side,
        blur[both],
        focal[both],
    )
    return [CandidateConstraints(block, grouped(both, side), 4)]


def _centring(problem: Problem) -> list[CandidateConstraints]:
    free = np.array([i for i, c in enumerate(problem.cameras) if not c.fixed], dtype=np.int64)
    out = []
    if problem.limits.centring is not None:
        camera = np.repeat(free, 2)
        pixels = problem.cameras[0].camera.focal_length_px
        tolerance = bound(problem.limits.centring.tolerance_px / pixels, camera)
        component = np.tile([0, 1], len(free))
        block: Block = MeanImageCoordinate(
            "centring",
            "px",
            pixels,
            -tolerance,
            tolerance,
            camera,
            component,
            (problem.points[: problem.object_points],),
        )
        out.append(CandidateConstraints.all_of(block))
    if problem.limits.incidence.mean_max_deg is not None:
        limit = bound(np.radians(problem.limits.incidence.mean_max_deg), free)
        normals = problem.subject.design_points.normals[: problem.object_points]
        block = MeanAxisIncidence(
            "incidence_mean", "deg", 180.0 / np.pi, bound(-_INF, free), limit, free, (normals,)
        )
        out.append(CandidateConstraints.all_of(block))
    return out


def ray_constraints(problem: Problem, framed: Bools) -> list[CandidateConstraints]:
    """All candidate rows about rays, for the points framed now."""
    camera, point = _extremes(problem, framed)
    rows = (
        _frame(problem, camera, point)
        + _depths(problem, camera, point)
        + _focus(problem, camera, point)
    )
    rows += _centring(problem)
    return [r for r in rows if r.block.rows]


def framing_violation(
    problem: Problem, state: NetworkState, camera: Ints, points_mm: Floats
) -> Floats:
    """By how much points (m, 3) break frame, focus or sampling distance of their cameras, (m,).

    In the solver's units, in the worst position of the head.
    """
    worst = np.zeros(len(camera))
    for position in problem.framing_positions if len(camera) else ():
        point = problem.scaled(position.points(points_mm))
        for rows in (
            _frame(problem, camera, point)
            + _depths(problem, camera, point)
            + _focus(problem, camera, point)
        ):
            each = rows.block.violation(state).reshape(len(camera), -1)
            worst = np.maximum(worst, each.max(axis=1))
    return worst
