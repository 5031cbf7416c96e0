"""Candidate rows about bodies: zones, collisions, views past neighbours.

Which face of a box or side of a view keeps two solids apart is a discrete choice; it is made
anew at the start of every outer iteration from where the cameras then are.
"""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats, Ints
from solver.constraints.base import Block, bound
from solver.constraints.bodies import BodyDistance, BodyPairs, BodyPlanes, ViewPlanes, carried
from solver.constraints.builders.rays import frame_normals
from solver.constraints.candidates import CandidateConstraints, grouped
from solver.limits import Box, HalfSpace, Sphere, Zone
from solver.problem import Problem
from solver.variables import NetworkState

_INF = np.inf
_KEEP = 3


def box_faces(box: Box) -> tuple[Floats, Floats]:
    """Inward normals (6, 3) and offsets (6,) of a box: inside is ``normal . x >= offset``."""
    normals = np.concatenate([np.eye(3), -np.eye(3)])
    return normals, np.concatenate([box.low_mm, -box.high_mm])


def _spheres_of(problem: Problem, state: NetworkState, i: int) -> tuple[Floats, Floats, Floats]:
    """Offsets (m, 3), radii (m,) and present centres (m, 3) of a camera's spheres."""
    offset, radius = problem.spheres[i]
    return offset, radius, carried(state, np.full(len(offset), i), offset)


def _planes(
    family: str, problem: Problem, i: int, normals: Floats, offsets_mm: Floats
) -> CandidateConstraints:
    """All spheres of camera i on the inner side of planes (k, 3), (k,)."""
    offset, radius = problem.spheres[i]
    shifted = (offsets_mm - normals @ problem.origin_mm) / problem.length_mm
    count = len(offsets_mm)
    plane = np.repeat(np.arange(count), len(offset))
    low = shifted[plane] + np.tile(radius, count)
    camera = np.full(len(low), i)
    block = BodyPlanes(
        family,
        "mm",
        problem.length_mm,
        low,
        bound(_INF, low),
        camera,
        np.tile(offset, (count, 1)),
        normals[plane],
    )
    return CandidateConstraints(block, plane, _KEEP)


def _ball(
    family: str, problem: Problem, i: int, zone: Sphere, inside: bool
) -> CandidateConstraints:
    offset, radius = problem.spheres[i]
    rim = zone.radius_mm / problem.length_mm
    camera = np.full(len(offset), i)
    low = bound(-_INF, offset) if inside else rim + radius
    high = rim - radius if inside else bound(_INF, offset)
    centre = np.tile(problem.scaled(zone.centre_mm), (len(offset), 1))
    block = BodyDistance(family, "mm", problem.length_mm, low, high, camera, offset, centre)
    return CandidateConstraints(block, grouped(camera), _KEEP)


def _inside(problem: Problem, i: int, zone: Zone) -> CandidateConstraints:
    if isinstance(zone, Sphere):
        return _ball("zone_allowed", problem, i, zone, inside=True)
    if isinstance(zone, HalfSpace):
        return _planes("zone_allowed", problem, i, zone.normal[None], np.array([zone.offset_mm]))
    return _planes("zone_allowed", problem, i, *box_faces(zone))


def _outside(problem: Problem, state: NetworkState, i: int, zone: Zone) -> CandidateConstraints:
    if isinstance(zone, Sphere):
        return _ball("zone_forbidden", problem, i, zone, inside=False)
    if isinstance(zone, HalfSpace):
        return _planes(
            "zone_forbidden", problem, i, -zone.normal[None], np.array([-zone.offset_mm])
        )
    normals, offsets = box_faces(zone)
    _, radius, centre = _spheres_of(problem, state, i)
    place = centre * problem.length_mm + problem.origin_mm
    clear = -(place @ normals.T) + offsets - radius[:, None] * problem.length_mm
    face = int(np.argmax(clear.min(axis=0)))
    return _planes(
        "zone_forbidden", problem, i, -normals[face : face + 1], -offsets[face : face + 1]
    )


def zone_constraints(problem: Problem, state: NetworkState) -> list[CandidateConstraints]:
    """Bodies inside one allowed zone, the nearest, and outside all forbidden ones."""
    zones = problem.zones
    out = []
    for i, camera in enumerate(problem.cameras):
        if camera.fixed:
            continue
        if zones.allowed:
            options = [_inside(problem, i, zone) for zone in zones.allowed]
            nearest = min(options, key=lambda o: float(o.block.violation(state).max()))
            out.append(nearest)
        out += [_outside(problem, state, i, zone) for zone in zones.forbidden]
    return out


def _sphere_table(problem: Problem) -> tuple[Ints, Floats, Floats]:
    """Camera (m,), offset (m, 3) and radius (m,) of all spheres."""
    camera = np.concatenate([np.full(len(r), i) for i, (_, r) in enumerate(problem.spheres)])
    offset = np.concatenate([o for o, _ in problem.spheres])
    return camera, offset, np.concatenate([r for _, r in problem.spheres])


def _collisions(problem: Problem, state: NetworkState) -> list[CandidateConstraints]:
    clearance = problem.limits.body_clearance_mm
    if clearance is None or problem.count < 2:
        return []
    camera, offset, radius = _sphere_table(problem)
    one, two = np.triu_indices(len(camera), 1)
    fixed = np.array([c.fixed for c in problem.cameras])
    apart = (camera[one] != camera[two]) & ~(fixed[camera[one]] & fixed[camera[two]])
    one, two = one[apart], two[apart]
    low = radius[one] + radius[two] + clearance / problem.length_mm
    block: Block = BodyPairs(
        "body_clearance",
        "mm",
        problem.length_mm,
        low,
        bound(_INF, low),
        camera[one],
        camera[two],
        offset[one],
        offset[two],
    )
    # Bodies far apart now are watched by the check after each solve, not row by row.
    near = np.flatnonzero(block.slack(state) < 0.5)
    block = block.take(near)
    return [CandidateConstraints(block, grouped(camera[one[near]], camera[two[near]]), 2)]


def _sight_lines(problem: Problem, state: NetworkState) -> list[CandidateConstraints]:
    clearance = problem.limits.sight_line_clearance_mm
    if clearance is None or problem.count < 2:
        return []
    camera, offset, radius = _sphere_table(problem)
    first = np.flatnonzero(np.diff(camera, prepend=-1))
    fixed = np.array([c.fixed for c in problem.cameras])
    place = carried(state, camera, offset)
    parts = []
    for i, looking in enumerate(problem.cameras):
        sides = np.concatenate([frame_normals(looking.camera.frame_limits()), [[0.0, 0.0, -1.0]]])
        sides /= np.linalg.norm(sides, axis=1, keepdims=True)
        local = (place - state.centre[i]) @ state.rotation[i].T
        clear = local @ sides.T - radius[:, None]
        side = np.argmax(np.minimum.reduceat(clear, first, axis=0), axis=1)
        rows = np.flatnonzero((camera != i) & ~(fixed[i] & fixed[camera]))
        parts.append((np.full(len(rows), i), rows, sides[side[camera[rows]]]))
    looks, rows = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    if not len(rows):
        return []
    low = radius[rows] + clearance / problem.length_mm
    block = ViewPlanes(
        "sight_line",
        "mm",
        problem.length_mm,
        low,
        bound(_INF, low),
        looks,
        camera[rows],
        offset[rows],
        np.concatenate([p[2] for p in parts]),
    )
    return [CandidateConstraints(block, grouped(looks, camera[rows]), 1)]


def body_constraints(problem: Problem, state: NetworkState) -> list[CandidateConstraints]:
    """All candidate rows about bodies."""
    rows = (
        zone_constraints(problem, state)
        + _collisions(problem, state)
        + _sight_lines(problem, state)
    )
    return [r for r in rows if r.block.rows]
