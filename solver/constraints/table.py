"""The constraint table of a network: each limit at its worst place, in its own unit.

Limits about rays are computed here from poses and pixels, apart from the rows that the solver
works on: a fault in those rows would show as a network that the solver calls feasible and
this table does not.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from geometry.arrays import Bools, Floats
from geometry.camera import RigCamera
from geometry.optics import blur_disk_mm
from solver.constraints.base import WeightedSum
from solver.constraints.builders.bodies import body_constraints
from solver.constraints.builders.positions import position_constraints
from solver.constraints.candidates import CandidateConstraints
from solver.limits import ROLL_TOLERANCE_DEG
from solver.problem import Problem
from solver.result import ConstraintRow, CoverageShare, Sense
from solver.variables import PER_CAMERA, NetworkState

SATISFIED = 1e-6
"""Relative violation up to which a limit counts as met: what the solver leaves by rounding."""

BINDING = 1e-3
"""Relative slack below which a limit is said to bind."""

_STEEPEST_DEG = 89.0


def row(
    name: str,
    value: float,
    limit: float,
    sense: Sense,
    unit: str,
    scale: float,
    tolerance: float = 0.0,
) -> ConstraintRow:
    """One line of the table; ``scale`` is the size against which slack is judged."""
    slack = {
        Sense.AT_MOST: limit - value,
        Sense.AT_LEAST: value - limit,
        Sense.EQUAL: tolerance - abs(value - limit),
    }[sense]
    size = max(abs(scale), 1e-12)
    active = slack < BINDING * size
    met = slack >= -SATISFIED * size
    return ConstraintRow(
        name, float(value), float(limit), sense, unit, float(slack), bool(active), bool(met)
    )


def constraint_table(
    problem: Problem, visible: list[Bools], coverage: tuple[CoverageShare, ...]
) -> tuple[ConstraintRow, ...]:
    """All limits that are switched on.

    ``visible`` (n, q) per head position of the scene's visibility positions.
    """
    seen = np.logical_or.reduce(visible)
    rows: list[ConstraintRow] = []
    for i, camera in enumerate(problem.cameras):
        rows += camera_rows(problem, camera, seen[i])
    rows += place_rows(problem)
    rows += coverage_rows(problem, coverage)
    rows += _of_bounds(problem)
    return tuple(rows)


def place_rows(problem: Problem) -> Iterator[ConstraintRow]:
    """The limits for which no ray need be cast, but for the bounds about an anchor."""
    state = problem.unknowns.state(problem.start_values())
    yield from _rolls(problem)
    yield from _means(problem)
    for candidates in position_constraints(problem, state) + body_constraints(problem, state):
        yield from _of_block(problem, state, candidates)


def camera_rows(problem: Problem, camera: RigCamera, seen: Bools) -> Iterator[ConstraintRow]:
    """Frame, focus and sampling distance of one camera, in all head positions.

    ``seen`` (q,): the check points that it sees in one of them or more.
    """
    limits, kind = problem.limits, camera.camera
    if limits.depth_of_field:
        nearest = kind.min_focus_distance_mm
        yield row(
            f"min_focus/{camera.name}",
            camera.focus_distance_mm,
            nearest,
            Sense.AT_LEAST,
            "mm",
            nearest,
        )
    if not seen.any():
        return
    corners = problem.hull(seen)
    points = np.concatenate([p.points(corners) for p in problem.framing_positions])
    pixels, depth = kind.project(camera.pose, points)
    if limits.frame is not None:
        w, h = kind.image_size_px
        border = np.minimum(pixels + 0.5, np.array([w, h]) - 0.5 - pixels)
        nearest_px = np.minimum(border[:, 0], border[:, 1])
        value = float(np.where(depth > 0.0, nearest_px, -np.inf).min())
        yield row(
            f"frame/{camera.name}", value, limits.frame.margin_px, Sense.AT_LEAST, "px", float(w)
        )
    if limits.depth_of_field:
        value = _largest_blur(camera, depth)
        limit = kind.circle_of_confusion_mm
        yield row(f"depth_of_field/{camera.name}", value, limit, Sense.AT_MOST, "mm", limit)
    else:
        nearest = kind.min_focus_distance_mm
        yield row(
            f"min_focus/{camera.name}",
            float(depth.min()),
            nearest,
            Sense.AT_LEAST,
            "mm",
            problem.length_mm,
        )
    if limits.gsd_max_mm is not None:
        value = float(depth.max()) / kind.focal_length_px
        yield row(
            f"gsd/{camera.name}", value, limits.gsd_max_mm, Sense.AT_MOST, "mm", limits.gsd_max_mm
        )


def _largest_blur(camera: RigCamera, depth: Floats) -> float:
    kind = camera.camera
    if (depth <= 0.0).any():
        return float("inf")
    return float(
        blur_disk_mm(depth, camera.focus_distance_mm, kind.focal_length_mm, kind.f_number).max()
    )


def _rolls(problem: Problem) -> Iterator[ConstraintRow]:
    """The roll of each camera that may be turned; one that looks straight up or down has none."""
    limit = problem.limits.roll
    for camera in problem.cameras if limit.allowed_deg else ():
        _, tilt, roll = (float(v) for v in camera.pose.pan_tilt_roll_deg)
        if camera.fixed or abs(tilt) > _STEEPEST_DEG:
            continue
        allowed = limit.nearest_deg(roll)
        value = allowed + (roll - allowed + 180.0) % 360.0 - 180.0
        width = ROLL_TOLERANCE_DEG
        yield row(f"roll/{camera.name}", value, allowed, Sense.EQUAL, "deg", width, width)


def _means(problem: Problem) -> Iterator[ConstraintRow]:
    """Eqs 12 and 10, whose means are taken over the design points."""
    source, limits = problem.subject.design_points, problem.limits
    for camera in problem.cameras:
        if limits.incidence.mean_max_deg is not None:
            cosine = np.clip(-(source.normals @ camera.pose.axis_rig), -1.0, 1.0)
            value = float(np.degrees(np.arccos(cosine)).mean())
            limit = limits.incidence.mean_max_deg
            yield row(f"incidence_mean/{camera.name}", value, limit, Sense.AT_MOST, "deg", limit)
    if limits.centring is None:
        return
    tolerance = limits.centring.tolerance_px
    for camera in problem.cameras:
        local = camera.pose.to_camera(source.points_mm)
        mean = (local[:, :2] / local[:, 2:]).mean(axis=0) * camera.camera.focal_length_px
        width = float(camera.camera.image_size_px[0])
        for axis, value in zip("xy", mean, strict=True):
            name = f"centring_{axis}/{camera.name}"
            yield row(name, float(value), 0.0, Sense.EQUAL, "px", width, tolerance)


@lru_cache(maxsize=4096)
def _subjects(columns: bytes, width: int) -> tuple[tuple[int, ...], ...]:
    """Cameras of each row, by the columns that it reads, (rows, width) int64.

    Kept: thousands of evaluations of one rig ask for the same rows again and again.
    """
    cameras = np.frombuffer(columns, dtype=np.int64).reshape(-1, width) // PER_CAMERA
    return tuple(tuple(dict.fromkeys(line)) for line in cameras.tolist())


def _of_block(
    problem: Problem, state: NetworkState, candidates: CandidateConstraints
) -> Iterator[ConstraintRow]:
    """Rows of places and bodies, the worst of each camera or pair."""
    block = candidates.block
    value = block.value(state)
    slack = np.minimum(value - block.lower, block.upper - value).tolist()
    if isinstance(block, WeightedSum):
        subjects: tuple[tuple[int, ...], ...] = ((-1,),) * block.rows
    else:
        columns = np.ascontiguousarray(block.columns, dtype=np.int64)
        subjects = _subjects(columns.tobytes(), columns.shape[1])
    worst: dict[tuple[int, ...], int] = {}
    for k, subject in enumerate(subjects):
        if subject not in worst or slack[k] < slack[worst[subject]]:
            worst[subject] = k
    for subject, k in worst.items():
        who = "-".join(problem.cameras[i].name for i in subject) if subject[0] >= 0 else "all"
        low, high = block.lower[k], block.upper[k]
        natural = block.natural
        clearance = block.family in _CLEARANCES
        if np.isfinite(low) and np.isfinite(high):
            middle, tolerance = 0.5 * (low + high), 0.5 * (high - low)
            yield row(
                f"{block.family}/{who}",
                value[k] * natural,
                middle * natural,
                Sense.EQUAL,
                block.unit,
                natural,
                tolerance * natural,
            )
        else:
            sense = Sense.AT_LEAST if np.isfinite(low) else Sense.AT_MOST
            limit = low if np.isfinite(low) else high
            # Distances of covering spheres are told as clearances between them.
            shift = limit - _clearance(problem, block.family) / natural if clearance else 0.0
            yield row(
                f"{block.family}/{who}",
                (value[k] - shift) * natural,
                (limit - shift) * natural,
                sense,
                block.unit,
                natural,
            )


_CLEARANCES = ("body_clearance", "sight_line", "zone_allowed", "zone_forbidden")


def _clearance(problem: Problem, family: str) -> float:
    """The clearance that the limit asks for between two solids, mm."""
    limits = problem.limits
    asked = {
        "body_clearance": limits.body_clearance_mm,
        "sight_line": limits.sight_line_clearance_mm,
    }
    return asked.get(family) or 0.0


def coverage_rows(problem: Problem, coverage: tuple[CoverageShare, ...]) -> Iterator[ConstraintRow]:
    """The limits on how many cameras see each point."""
    reached = {c.views: c.share for c in coverage}
    for tier in problem.limits.coverage.tiers:
        share = reached.get(min(tier.views, problem.count), 0.0)
        yield row(f"coverage_{tier.views}/all", share, tier.share, Sense.AT_LEAST, "", 1.0)


def _of_bounds(problem: Problem) -> Iterator[ConstraintRow]:
    """Eq 8 about the anchor, the tightest coordinate of each kind."""
    box = problem.limits.bounds
    if box is None or problem.anchor is None:
        return
    for camera, anchor in zip(problem.cameras, problem.anchor, strict=True):
        turned = camera.pose.omega_phi_kappa_deg - anchor.omega_phi_kappa_deg
        turned = (turned + 180.0) % 360.0 - 180.0
        moved = camera.pose.position_rig_mm - anchor.position_rig_mm
        for name, value, half, unit in (
            *zip(
                ("omega", "phi", "kappa"),
                turned,
                (box.omega_deg, box.phi_deg, box.kappa_deg),
                ["deg"] * 3,
                strict=True,
            ),
            *zip("xyz", moved, (box.x_mm, box.y_mm, box.z_mm), ["mm"] * 3, strict=True),
        ):
            if half is not None:
                yield row(
                    f"bound_{name}/{camera.name}",
                    abs(float(value)),
                    half,
                    Sense.AT_MOST,
                    unit,
                    max(half, 1.0),
                )
