"""Poses of all cameras from carriers that several of them see: a chain of relative poses."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.resection import RigidTransform, placed_candidates
from calibration.adjustment.initialisation.views import View
from geometry.arrays import Floats, Ints

LEAST_POINTS = 4
MOST_SHARED = 10
"""Places of one pair that are tried against each other; more only take time."""


@dataclass(frozen=True, eq=False)
class LocatedView:
    """A view with its carrier's coordinates and where the carrier may stand."""

    view: View
    points_mm: Floats
    normalised: Floats
    candidates: tuple[RigidTransform, ...]

    def misfit(self, placed: RigidTransform, focal_px: float) -> float:
        """Root mean square misfit in pixels; infinite behind the camera."""
        residual = (placed.image(self.points_mm) - self.normalised) * focal_px
        if not np.isfinite(residual).all():
            return np.inf
        return float(np.sqrt(np.mean(np.sum(residual * residual, axis=1))))


def located_views(
    views: tuple[View, ...], target: Ints, normalised: Floats, points_mm: Floats
) -> tuple[LocatedView, ...]:
    """Views of carriers whose coordinates are known well enough for a resection.

    ``target`` and ``normalised`` (n, 2) by row; ``points_mm`` (m, 3), NaN where unknown.
    """
    out = []
    for view in views:
        points = points_mm[target[view.rows]]
        known = finite_rows(points)
        if known.sum() < LEAST_POINTS:
            continue
        image = normalised[view.rows][known]
        found = placed_candidates(points[known], image)
        if found:
            out.append(LocatedView(view, points[known], image, tuple(found)))
    return tuple(out)


def compose(second: RigidTransform, first: RigidTransform) -> RigidTransform:
    """``second`` after ``first``."""
    return RigidTransform(
        second.rotation @ first.rotation,
        second.rotation @ first.translation_mm + second.translation_mm,
    )


def inverse(placed: RigidTransform) -> RigidTransform:
    """The other way round."""
    return RigidTransform(placed.rotation.T, -placed.rotation.T @ placed.translation_mm)


def chain(views: tuple[LocatedView, ...], focal_px: Floats) -> dict[int, RigidTransform]:
    """Poses (world to camera) of all cameras that hang together with the best connected one."""
    by_camera: dict[int, dict[int, LocatedView]] = defaultdict(dict)
    for one in views:
        by_camera[one.view.camera][one.view.place] = one
    links = {}
    for a in by_camera:
        for b in by_camera:
            if a < b and (found := _link(by_camera[a], by_camera[b], focal_px[[a, b]])):
                links[a, b], links[b, a] = found, (inverse(found[0]), found[1])
    if not by_camera:
        return {}
    root = min(by_camera, key=lambda c: (-sum(pair[0] == c for pair in links), c))
    return _tree(root, links)


def _tree(
    root: int, links: dict[tuple[int, int], tuple[RigidTransform, float]]
) -> dict[int, RigidTransform]:
    """Camera by camera over the link that fits best (Prim)."""
    poses = {root: RigidTransform(np.eye(3), np.zeros(3))}
    while True:
        open_links = [
            (cost, a, b) for (a, b), (_, cost) in links.items() if a in poses and b not in poses
        ]
        if not open_links:
            return poses
        _, a, b = min(open_links)
        poses[b] = compose(links[a, b][0], poses[a])


def _link(
    first: dict[int, LocatedView], second: dict[int, LocatedView], focal_px: Floats
) -> tuple[RigidTransform, float] | None:
    """How to get from the first camera's frame to the second's, and its cost."""
    shared = sorted(set(first) & set(second), key=lambda p: (-len(second[p].points_mm), p))
    shared = shared[:: max(1, len(shared) // MOST_SHARED)][:MOST_SHARED]
    best: tuple[RigidTransform, float] | None = None
    for place in shared:
        for a in first[place].candidates:
            for b in second[place].candidates:
                pose = compose(b, inverse(a))
                cost = _disagreement(pose, first, second, shared, focal_px)
                if best is None or cost < best[1]:
                    best = pose, cost
    if best is None or not np.isfinite(best[1]):
        return None
    points = sum(len(second[p].points_mm) for p in shared)
    return best[0], best[1] / np.sqrt(points)


def _disagreement(
    pose: RigidTransform,
    first: dict[int, LocatedView],
    second: dict[int, LocatedView],
    shared: list[int],
    focal_px: Floats,
) -> float:
    """Median over shared places of the misfit of one camera's answers in the other, pixels."""
    back, costs = inverse(pose), []
    for place in shared:
        there = min(
            second[place].misfit(compose(pose, a), focal_px[1]) for a in first[place].candidates
        )
        here = min(
            first[place].misfit(compose(back, b), focal_px[0]) for b in second[place].candidates
        )
        costs.append(min(there, here))
    # Of an even number the upper median: with two places both must agree.
    return float(np.sort(costs)[len(costs) // 2])
