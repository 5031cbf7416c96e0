"""The face region of a scan: nose tip, radius, front-facing, reachable."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from common.errors import InputError
from geometry.arrays import Bools, Floats, frozen
from geometry.frames import FORWARD_RIG
from geometry.raycast import Occluder
from geometry.scan import Scan
from geometry.surface import SurfacePoints

RADIUS_MM = 95.0
"""Default radius about the nose tip: forehead, cheeks to before the ears, chin; not the neck."""

MAX_NORMAL_DEG = 65.0
"""Default largest angle between a point's normal and the direction of the face."""

_CELL_MM = 2.0
_NOSE_RING_MM = 22.0
_CHEEK_MM = 50.0
_ABOVE_MM = 45.0
_MIN_DROP_MM = 5.0
_MIN_SHARPNESS = 0.26
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


def _depth_map(scan: Scan, occluder: Occluder) -> tuple[Floats, Floats, Floats]:
    """Depth y (nz, nx) of the surface seen from the front, NaN for none, with its x and z."""
    low, high = scan.vertices_mm.min(axis=0), scan.vertices_mm.max(axis=0)
    x = np.arange(low[0], high[0] + _CELL_MM, _CELL_MM)
    z = np.arange(low[2], high[2] + _CELL_MM, _CELL_MM)
    grid_x, grid_z = np.meshgrid(x, z)
    start = low[1] - 10.0
    origins = np.stack([grid_x.ravel(), np.full(grid_x.size, start), grid_z.ravel()], axis=1)
    triangle, distance = occluder.first_hits(origins, np.tile([0.0, 1.0, 0.0], (len(origins), 1)))
    depth = np.where(triangle >= 0, start + distance, np.nan).reshape(grid_x.shape)
    return depth, x, z


def _shifted(depth: Floats, dx_mm: float, dz_mm: float) -> Floats:
    """The map as seen from a place ``dx``, ``dz`` further, NaN beyond its edge."""
    out = np.full_like(depth, np.nan)
    kx, kz = round(dx_mm / _CELL_MM), round(dz_mm / _CELL_MM)
    rows, columns = depth.shape
    if abs(kx) >= columns or abs(kz) >= rows:
        return out
    source = depth[max(0, kz) : rows + min(0, kz), max(0, kx) : columns + min(0, kx)]
    out[max(0, -kz) : rows + min(0, -kz), max(0, -kx) : columns + min(0, -kx)] = source
    return out


def _nose_score(depth: Floats) -> Floats:
    """How much each place of the map is like a nose tip; -inf where it cannot be one.

    A nose tip stands out by several millimetres against both sides, above and below, more
    sharply than the face as a whole does against the cheeks: a ball does not.
    """

    def drop(dx: float, dz: float) -> Floats:
        return _shifted(depth, dx, dz) - depth

    near = [drop(-_NOSE_RING_MM, 0.0), drop(_NOSE_RING_MM, 0.0)]
    cheeks = [drop(-_CHEEK_MM, 0.0), drop(_CHEEK_MM, 0.0)]
    upright = [drop(0.0, _NOSE_RING_MM), drop(0.0, -_NOSE_RING_MM)]
    face = [drop(0.0, _ABOVE_MM), drop(0.0, -_ABOVE_MM)]
    with np.errstate(invalid="ignore"):
        sides = np.minimum(*near)
        sharpness = (near[0] + near[1]) / np.maximum(cheeks[0] + cheeks[1], 1e-9)
        possible = (
            (sides > _MIN_DROP_MM)
            & (np.minimum(*upright) > 0.4 * _MIN_DROP_MM)
            & (np.minimum(*cheeks) > 10.0)
            & (np.maximum(*cheeks) < 100.0)
            & np.isfinite(face[0] + face[1])
            & (np.maximum(*face) < 60.0)
            & (sharpness > _MIN_SHARPNESS)
        )
        score = sides + 0.5 * np.minimum(*upright) - 0.5 * np.abs(near[0] - near[1])
    return np.where(possible, score, -np.inf)


def nose_tip(scan: Scan, occluder: Occluder) -> Floats:
    """The nose tip (3,) in the rig frame. Raises :class:`InputError` when there is no face."""
    depth, x, z = _depth_map(scan, occluder)
    seen = np.isfinite(depth)
    filled = np.where(seen, depth, np.nanmax(depth) if seen.any() else 0.0)
    smooth = np.where(seen, median_filter(filled, 3), np.nan)
    score = _nose_score(smooth)
    if not np.isfinite(score).any():
        raise InputError(
            "face-not-found",
            "no face was found in the scan",
            "check its units, up and front, or give the region as a box or a sphere",
        )
    row, column = np.unravel_index(int(np.argmax(score)), score.shape)
    about = np.hypot(*np.meshgrid(x - x[column], z - z[row])) <= 8.0
    candidates = np.where(about & seen, smooth, np.inf)
    row, column = np.unravel_index(int(np.argmin(candidates)), candidates.shape)
    return np.array([x[column], smooth[row, column], z[row]])


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
    tip = nose_tip(scan, occluder)
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
