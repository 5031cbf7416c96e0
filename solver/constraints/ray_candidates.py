"""Candidate rows about rays: frame, sampling distance, focus, centring, promised views."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from solver.constraints.base import Block, bound
from solver.constraints.candidates import Candidates, grouped
from solver.constraints.places import PlaceCones
from solver.constraints.rays import FocusRays, MeanAxisIncidence, MeanImageCoordinate, RayPlanes
from solver.coverage.assignment import Promises
from solver.problem import Scene

_INF = np.inf


def _extremes(scene: Scene, framed: Bools) -> tuple[Ints, Floats]:
    """Cameras (m,) and points (m, 3): the corners of what each free camera frames, head moved."""
    cameras, points = [], []
    for i, camera in enumerate(scene.cameras):
        if camera.fixed:
            continue
        corners = scene.hull(framed[i])
        moved = np.concatenate([scene.scaled(p.points(corners)) for p in scene.framing_positions])
        cameras.append(np.full(len(moved), i))
        points.append(moved)
    return np.concatenate(cameras), np.concatenate(points)


def _frame(scene: Scene, camera: Ints, point: Floats) -> list[Candidates]:
    if scene.limits.frame is None:
        return []
    sides = np.empty((scene.count, 4, 3))
    for i, c in enumerate(scene.cameras):
        sides[i] = frame_normals(c.camera.frame_limits(scene.limits.frame.margin_px))
    count = len(camera)
    side = np.tile(np.arange(4), count)
    camera, point = np.repeat(camera, 4), np.repeat(point, 4, axis=0)
    pixels = scene.cameras[0].camera.focal_length_px
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
    return [Candidates(block, grouped(camera, side), 4)]


def frame_normals(limits: Floats) -> Floats:
    """Normals (4, 3) in the camera frame of the sides of a frame given as left, right, top, bottom.

    A point is inside a side when ``normal . p <= 0``; the sides come in the order left, right,
    top, bottom.
    """
    left, right, top, bottom = limits
    return np.array([[-1.0, 0.0, left], [1.0, 0.0, -right], [0.0, -1.0, top], [0.0, 1.0, -bottom]])


def _depths(scene: Scene, camera: Ints, point: Floats) -> list[Candidates]:
    """Ground sample distance and, without depth of field, the minimum focus distance."""
    gsd, scale = scene.limits.gsd_max_mm, scene.length_mm
    forward = np.tile([0.0, 0.0, 1.0], (len(camera), 1))
    out = []
    if gsd is not None:
        pixels = np.array([c.camera.focal_length_px for c in scene.cameras])
        farthest = gsd * pixels[camera] / scale
        block = RayPlanes(
            "gsd", "mm", scale / pixels[0], bound(-_INF, camera), farthest, camera, point, forward
        )
        out.append(Candidates(block, grouped(camera), 4))
    if not scene.limits.depth_of_field:
        near = np.array([c.camera.min_focus_distance_mm for c in scene.cameras]) / scale
        block = RayPlanes(
            "min_focus", "mm", scale, near[camera], bound(_INF, camera), camera, point, forward
        )
        out.append(Candidates(block, grouped(camera), 4))
    return out


def _focus(scene: Scene, camera: Ints, point: Floats) -> list[Candidates]:
    if not scene.limits.depth_of_field:
        return []
    scale = scene.length_mm
    kinds = [c.camera for c in scene.cameras]
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
    return [Candidates(block, grouped(both, side), 4)]


def _centring(scene: Scene) -> list[Candidates]:
    free = np.array([i for i, c in enumerate(scene.cameras) if not c.fixed], dtype=np.int64)
    out = []
    if scene.limits.centring is not None:
        camera = np.repeat(free, 2)
        pixels = scene.cameras[0].camera.focal_length_px
        tolerance = bound(scene.limits.centring.tolerance_px / pixels, camera)
        component = np.tile([0, 1], len(free))
        block: Block = MeanImageCoordinate(
            "centring",
            "px",
            pixels,
            -tolerance,
            tolerance,
            camera,
            component,
            (scene.points[: scene.object_points],),
        )
        out.append(Candidates.all_of(block))
    if scene.limits.incidence.mean_max_deg is not None:
        limit = bound(np.radians(scene.limits.incidence.mean_max_deg), free)
        normals = scene.subject.design_points.normals[: scene.object_points]
        block = MeanAxisIncidence(
            "incidence_mean", "deg", 180.0 / np.pi, bound(-_INF, free), limit, free, (normals,)
        )
        out.append(Candidates.all_of(block))
    return out


def promise_rows(scene: Scene, promises: Promises, margin_deg: float) -> Candidates:
    """Incidence of every promised ray, in every head position, (m,) rows."""
    scale = scene.length_mm
    opening = np.cos(np.radians(scene.limits.incidence.ray_max_deg - margin_deg))
    source = scene.subject.design_points
    points, normals = source.points_mm[promises.point], source.normals[promises.point]
    positions = scene.visibility_positions
    point = np.concatenate([scene.scaled(p.points(points)) for p in positions])
    normal = np.concatenate([p.directions(normals) for p in positions])
    camera = np.tile(promises.camera, len(positions))
    block = PlaceCones(
        "coverage",
        "mm",
        scale,
        bound(0.0, camera),
        bound(_INF, camera),
        camera,
        point,
        normal,
        bound(opening, camera),
    )
    return Candidates(block, grouped(camera), 12)


def ray_rows(
    scene: Scene, framed: Bools, promises: Promises, margin_deg: float
) -> list[Candidates]:
    """All candidate rows about rays, for the points framed and the views promised now."""
    camera, point = _extremes(scene, framed)
    rows = (
        _frame(scene, camera, point) + _depths(scene, camera, point) + _focus(scene, camera, point)
    )
    rows += _centring(scene)
    if len(promises.point):
        rows.append(promise_rows(scene, promises, margin_deg))
    return [r for r in rows if r.block.rows]
