"""Carriers put in their places, and targets of unknown coordinates found, with cameras known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.chain import LocatedView, compose, inverse
from calibration.adjustment.initialisation.rays import nearest_points
from calibration.adjustment.initialisation.resection import RigidTransform
from calibration.adjustment.initialisation.views import Placements
from calibration.adjustment.rotations import similarity
from geometry.arrays import Bools, Floats, Ints

CAP_PX = 100.0
"""Misfits beyond this count as this: one swapped camera must not choose a carrier's place."""


@dataclass(frozen=True, eq=False)
class RowRays:
    """What is needed of each row: ``place``, ``target`` (n,); ``origin``, ``way`` (n, 3)."""

    place: Ints
    target: Ints
    origin: Floats
    way: Floats


@dataclass(frozen=True, eq=False)
class Placing:
    """``placed`` of each place (carrier to world), None where it could not be found.

    ``target_mm`` (m, 3) in carrier frames, NaN where not found; ``held`` (k,) the places that
    define the frame of a carrier without coordinates.
    """

    placed: tuple[RigidTransform | None, ...]
    target_mm: Floats
    held: Bools


def row_rays(
    poses: dict[int, RigidTransform],
    camera: Ints,
    normalised: Floats,
    placements: Placements,
    target: Ints,
) -> RowRays:
    """Rays of all rows whose camera has a pose; the others get NaN."""
    origin, way = np.full((len(camera), 3), np.nan), np.full((len(camera), 3), np.nan)
    for index, pose in poses.items():
        rows = camera == index
        directions = np.c_[normalised[rows], np.ones(int(rows.sum()))] @ pose.rotation
        way[rows] = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        origin[rows] = -pose.rotation.T @ pose.translation_mm
    return RowRays(placements.of_row, target, origin, way)


def place_carriers(
    poses: dict[int, RigidTransform],
    views: tuple[LocatedView, ...],
    rays: RowRays,
    placements: Placements,
    nominal_mm: Floats,
    carrier_of: Ints,
    focal_px: Floats,
) -> Placing:
    """Places of all carriers, and targets that had no nominal coordinates."""
    placed = _from_resections(poses, views, len(placements.carrier), focal_px)
    world = _points_by_place(rays, len(placed), len(nominal_mm))
    target = nominal_mm.copy()
    held = np.zeros(len(placed), bool)
    for carrier in np.unique(placements.carrier):
        own = carrier_of == carrier
        places = np.flatnonzero(placements.carrier == carrier)
        if not finite_rows(target[own]).any():
            best = int(max(places, key=lambda p: finite_rows(world[p][own]).sum()))
            placed[best], held[best] = RigidTransform(np.eye(3), np.zeros(3)), True
            target[own] = world[best][own]
        _fit_missing(placed, places, world, target, own)
        _fill_unknown(placed, places, world, target, own)
    return Placing(tuple(placed), target, held)


def _from_resections(
    poses: dict[int, RigidTransform], views: tuple[LocatedView, ...], count: int, focal_px: Floats
) -> list[RigidTransform | None]:
    by_place: list[list[LocatedView]] = [[] for _ in range(count)]
    for one in views:
        if one.view.camera in poses:
            by_place[one.view.place].append(one)
    out: list[RigidTransform | None] = []
    for group in by_place:
        answers = [
            compose(inverse(poses[one.view.camera]), candidate)
            for one in group
            for candidate in one.candidates
        ]
        costs = [_cost(answer, group, poses, focal_px) for answer in answers]
        out.append(answers[int(np.argmin(costs))] if answers else None)
    return out


def _cost(
    placed: RigidTransform,
    group: list[LocatedView],
    poses: dict[int, RigidTransform],
    focal_px: Floats,
) -> float:
    return sum(
        min(
            one.misfit(compose(poses[one.view.camera], placed), float(focal_px[one.view.camera])),
            CAP_PX,
        )
        for one in group
    )


def _points_by_place(rays: RowRays, places: int, targets: int) -> Floats:
    """Targets in the world at each place, (places, targets, 3), NaN where rays do not meet."""
    used = finite_rows(rays.origin) & finite_rows(rays.way)
    group = rays.place[used] * targets + rays.target[used]
    points = nearest_points(rays.origin[used], rays.way[used], group, places * targets)
    return points.reshape(places, targets, 3)


def _fit_missing(
    placed: list[RigidTransform | None], places: Ints, world: Floats, target: Floats, own: Bools
) -> None:
    """Places that no resection gave: a fit of the intersected targets, as for a bar of two."""
    for place in places:
        both = own & finite_rows(target) & finite_rows(world[place])
        if placed[place] is None and both.sum() >= 2:
            _, rotation, translation = similarity(target[both], world[place][both])
            placed[place] = RigidTransform(rotation, translation)


def _fill_unknown(
    placed: list[RigidTransform | None], places: Ints, world: Floats, target: Floats, own: Bools
) -> None:
    """Targets without coordinates: their mean over all places, in the carrier's frame."""
    missing = np.flatnonzero(own & ~finite_rows(target))
    if len(missing) == 0:
        return
    seen = []
    for place in places:
        pose = placed[place]
        if pose is not None:
            seen.append((world[place][missing] - pose.translation_mm) @ pose.rotation)
    if seen:
        stack = np.stack(seen)
        good = np.isfinite(stack).all(axis=2, keepdims=True)
        total = np.where(good, stack, 0.0).sum(axis=0)
        with np.errstate(invalid="ignore"):
            target[missing] = total / good.sum(axis=0)
