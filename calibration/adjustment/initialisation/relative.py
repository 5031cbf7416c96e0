"""Poses of all cameras from points of unknown place: relative orientation, then resections."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from calibration.adjustment.finite import finite_rows
from calibration.adjustment.initialisation.chain import compose
from calibration.adjustment.initialisation.rays import nearest_points
from calibration.adjustment.initialisation.resection import (
    RigidTransform,
    placed_candidates,
    relative_pose,
)
from geometry.arrays import Floats, Ints

LEAST_COMMON = 8
TOLERANCE_PX = 3.0


@dataclass(frozen=True, eq=False)
class Scene:
    """Rays by row: ``camera``, ``point`` (n,), ``normalised`` (n, 2); ``focal_px`` (cameras,)."""

    camera: Ints
    point: Ints
    normalised: Floats
    focal_px: Floats

    @property
    def point_count(self) -> int:
        """Number of points."""
        return int(self.point.max(initial=-1)) + 1

    def points(self, poses: dict[int, RigidTransform]) -> Floats:
        """Points (p, 3) from the rays of posed cameras; NaN where too few meet."""
        used = np.flatnonzero(np.isin(self.camera, list(poses)))
        directions = np.c_[self.normalised[used], np.ones(len(used))]
        rotations = np.stack([poses[int(c)].rotation for c in self.camera[used]])
        translations = np.stack([poses[int(c)].translation_mm for c in self.camera[used]])
        directions = np.einsum("nji,nj->ni", rotations, directions)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        origins = -np.einsum("nji,nj->ni", rotations, translations)
        return nearest_points(origins, directions, self.point[used], self.point_count)

    def table(self) -> Floats:
        """Normalised coordinates (cameras, p, 2), NaN where unseen."""
        out = np.full((len(self.focal_px), self.point_count, 2), np.nan)
        out[self.camera, self.point] = self.normalised
        return out


def relative_chain(scene: Scene) -> dict[int, RigidTransform]:
    """Poses (world to camera) in a frame of any size; only the cameras that could be joined."""
    table = scene.table()
    poses = _seed(table, scene)
    while poses and len(poses) < len(table):
        points = scene.points(poses)
        known = finite_rows(points)
        open_cameras = [c for c in range(len(table)) if c not in poses]
        seen = {c: known & finite_rows(table[c]) for c in open_cameras}
        camera = max(open_cameras, key=lambda c: int(seen[c].sum()))
        pose = _resect(points[seen[camera]], table[camera][seen[camera]])
        if pose is None:
            break
        poses[camera] = pose
    return poses


def _resect(points: Floats, normalised: Floats) -> RigidTransform | None:
    if len(points) < LEAST_COMMON:
        return None
    found = placed_candidates(points, normalised)
    if not found:
        return None
    return min(
        found, key=lambda p: float(np.nan_to_num(p.image(points) - normalised, nan=9.0).std())
    )


def _seed(table: Floats, scene: Scene) -> dict[int, RigidTransform]:
    """The pair of cameras that fixes most points well: many points, wide angles."""
    best: tuple[float, dict[int, RigidTransform]] = (0.0, {})
    for a, b in itertools.combinations(range(len(table)), 2):
        common = np.isfinite(table[[a, b]]).all(axis=(0, 2))
        if common.sum() < LEAST_COMMON:
            continue
        focal = float(np.sqrt(scene.focal_px[a] * scene.focal_px[b]))
        found = relative_pose(table[a, common], table[b, common], TOLERANCE_PX / focal)
        if found is None:
            continue
        poses = {a: RigidTransform(np.eye(3), np.zeros(3))}
        poses[b] = compose(found[0], poses[a])
        points = scene.points(poses)[common][found[1]]
        depth = np.median(points[finite_rows(points), 2])
        # The base is 1 long: its share of the depth is the angle at which the rays meet.
        worth = float(found[1].sum() * min(1.0, 1.0 / max(depth, 1e-9)))
        if worth > best[0]:
            best = worth, poses
    return best[1]
