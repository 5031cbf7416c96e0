"""The face region of a scan: nose tip, radius, front-facing, reachable."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from common.errors import InputError
from geometry.arrays import Bools, Floats, frozen
from geometry.frames import FORWARD_RIG
from geometry.locating.finding import SURE, locate_face
from geometry.raycast import Occluder
from geometry.sampling import spread
from geometry.scan import Scan
from geometry.surface import SurfacePoints

RADIUS_MM = 95.0
"""Default radius about the nose tip: forehead, cheeks to before the ears, chin; not the neck."""

MAX_NORMAL_DEG = 65.0
"""Default largest angle between a point's normal and the direction of the face."""

_LINK_MM = 4.0
_LOOK_DEG = 60.0
_LOOK_STEP_DEG = 15.0
_LOOK_INCIDENCE_DEG = 70.0
_LOOK_SHARE = 0.2
_FAR_MM = 1000.0


@dataclass(frozen=True, eq=False)
class RegionBox:
    """A box of the rig frame, ``low_mm`` to ``high_mm`` (3,)."""

    low_mm: Floats
    high_mm: Floats

    def __post_init__(self) -> None:
        low, high = frozen(self.low_mm), frozen(self.high_mm)
        if low.shape != (3,) or high.shape != (3,) or not (low < high).all():
            raise InputError(
                "region-box", "the region's box is not low < high in x, y and z", "give two corners"
            )
        object.__setattr__(self, "low_mm", low)
        object.__setattr__(self, "high_mm", high)

    def holds(self, points_mm: Floats) -> Bools:
        """Which points (n, 3) are inside, (n,)."""
        return np.asarray(((points_mm >= self.low_mm) & (points_mm <= self.high_mm)).all(axis=1))


@dataclass(frozen=True, eq=False)
class RegionSphere:
    """A ball of the rig frame."""

    centre_mm: Floats
    radius_mm: float

    def __post_init__(self) -> None:
        centre = frozen(self.centre_mm)
        if centre.shape != (3,) or not np.isfinite(centre).all() or not self.radius_mm > 0.0:
            raise InputError(
                "region-sphere",
                "the region's sphere is malformed",
                "give centre_mm of 3 numbers and a positive radius_mm",
            )
        object.__setattr__(self, "centre_mm", centre)

    def holds(self, points_mm: Floats) -> Bools:
        """Which points (n, 3) are inside, (n,)."""
        return np.asarray(np.linalg.norm(points_mm - self.centre_mm, axis=1) <= self.radius_mm)


@dataclass(frozen=True, eq=False)
class FaceRegion:
    """Where the face is: points within ``radius_mm`` of the nose tip that face ``forward``.

    ``nose_tip_mm`` (3,) in the rig frame; ``excluded_share`` of those points cannot be seen
    well from the front (the inside of nostrils, behind the ears) and are left out.
    """

    nose_tip_mm: Floats
    forward: Floats
    radius_mm: float
    max_normal_deg: float
    excluded_share: float


def nose_tip(scan: Scan) -> Floats:
    """The nose tip (3,) in the rig frame. Raises :class:`InputError` when there is no face."""
    if scan.face is not None:
        return scan.face.nose_tip_mm
    found = locate_face(spread(scan.vertices_mm, scan.faces, scan.normals), np.eye(3))
    if found is None or found.confidence < SURE:
        raise InputError(
            "face-not-found",
            "no face was found for certain in the scan",
            "check its units, up and front, give nose_tip, left_eye and right_eye, or give the "
            "region as a box or a sphere",
        )
    return found.nose_tip_mm


def _look_directions() -> Floats:
    """Directions (m, 3) towards the front, within 60 degrees of it."""
    steps = np.radians(np.arange(-_LOOK_DEG, _LOOK_DEG + 1.0, _LOOK_STEP_DEG))
    yaw, pitch = (g.ravel() for g in np.meshgrid(steps, steps))
    out = np.stack(
        [np.sin(yaw) * np.cos(pitch), -np.cos(yaw) * np.cos(pitch), np.sin(pitch)], axis=1
    )
    return np.asarray(out[out @ FORWARD_RIG >= np.cos(np.radians(_LOOK_DEG)) - 1e-9])


def reachable(points: SurfacePoints, occluder: Occluder) -> Bools:
    """Points that a fair share of the directions in front see at a fair angle, (n,)."""
    views = np.zeros(len(points), dtype=np.int64)
    directions = _look_directions()
    limit = np.cos(np.radians(_LOOK_INCIDENCE_DEG))
    for direction in directions:
        facing = np.flatnonzero(points.normals @ direction >= limit)
        eyes = points.points_mm[facing] + _FAR_MM * direction
        views[facing] += ~occluder.hidden(points.points_mm[facing], points.normals[facing], eyes)
    return np.asarray(views >= _LOOK_SHARE * len(directions))


def connected_to(points_mm: Floats, seed_mm: Floats) -> Bools:
    """Points that hang together with the one nearest to ``seed_mm``, (n,)."""
    tree = cKDTree(points_mm)
    pairs = tree.query_pairs(_LINK_MM, output_type="ndarray")
    count = len(points_mm)
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(count, count))
    label = connected_components(graph, directed=False)[1]
    return np.asarray(label == label[tree.query(seed_mm)[1]])


def find_face(
    scan: Scan,
    samples: SurfacePoints,
    radius_mm: float = RADIUS_MM,
    max_normal_deg: float = MAX_NORMAL_DEG,
) -> tuple[FaceRegion, SurfacePoints]:
    """The face region and those of the ``samples`` that belong to it.

    Raises :class:`InputError` when no face is found.
    """
    occluder = scan.occluder()
    tip = nose_tip(scan)
    near = np.linalg.norm(samples.points_mm - tip, axis=1) <= radius_mm
    facing = samples.normals @ FORWARD_RIG >= np.cos(np.radians(max_normal_deg))
    if not (near & facing).any():
        raise InputError(
            "face-not-found",
            "nothing near the nose tip faces the front",
            "check up and front of the scan, or give the region as a box or a sphere",
        )
    face = samples.subset(near & facing)
    face = face.subset(connected_to(face.points_mm, tip))
    open_ = reachable(face, occluder)
    if not open_.any():
        raise InputError(
            "face-not-found",
            "no point of the face can be seen from the front",
            "check that the scan's front faces the cameras",
        )
    excluded = float(1.0 - open_.mean())
    region = FaceRegion(frozen(tip), FORWARD_RIG, radius_mm, max_normal_deg, excluded)
    return region, face.subset(open_)
