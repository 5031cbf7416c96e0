"""Places where a camera may stand, and what it may see from there, taken leniently."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from geometry.camera import Camera
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from solver.coverage.visibility import cast_rays
from solver.feasibility.nearest import BETWEEN_AIMS, aims, depths, sharp_from_mm
from solver.limits import Box, Limits, Sphere, StandOff, Zone
from solver.motion import rest
from solver.starts import better_roll
from solver.zones import in_rig_frame, inside_any

STEP_DEG = 8.0
FINER_DEG = 4.0
"""Steps between places: the finer where few can have what they see as the limits ask."""

_POINTS = 500
_RINGS = 8
_FARTHEST_RADII = 100.0
_USUAL_RADII = 6.0
_LEAST_SEEN = 3

BETWEEN_DEG = 5.7
"""The middle of four places ``STEP_DEG`` apart is so far from each of them."""

_FEW = 0.25

NEARER = 0.8
"""A camera that aims and tilts as suits it best may stand this much nearer than one that looks at
the middle, but not much more: the points that it frames stay the same."""


@dataclass(frozen=True, eq=False)
class Places:
    """Places (m, 3) where stand-off and zones let a camera stand, and what is seen from there."""

    subject: Subject
    camera: Camera
    limits: Limits
    step_deg: float = STEP_DEG

    @property
    def between_deg(self) -> float:
        """How far a camera may be from the nearest place as seen from the middle."""
        return BETWEEN_DEG * self.step_deg / STEP_DEG

    @property
    def between_ratio(self) -> float:
        """The same as base/height."""
        return float(np.radians(self.between_deg))

    @cached_property
    def points(self) -> SurfacePoints:
        """Some of the check points, spread evenly over them all."""
        every = self.subject.check_points
        return every.subset(np.arange(len(every))[:: max(1, len(every) // _POINTS)])

    @cached_property
    def middle(self) -> Floats:
        """Centroid of the design points, (3,)."""
        return self.subject.design_points.centroid_mm

    @cached_property
    def reach_mm(self) -> tuple[float, float]:
        """Least and greatest distance that is looked at."""
        radius, stand_off = self.subject.design_points.radius_mm, self.limits.stand_off
        low = max(stand_off.min_mm or 0.0, 1.05 * radius)
        return low, max(low, stand_off.max_mm or _FARTHEST_RADII * radius)

    @cached_property
    def _ways(self) -> tuple[Floats, Ints, Floats]:
        """Directions (d, 3), the direction of each place (m,), and the places (m, 3)."""
        low, high = self.reach_mm
        distance = np.geomspace(low, high, _RINGS)
        ways = all_around(self.step_deg)
        places = self.middle + (distance[None, :, None] * ways[:, None]).reshape(-1, 3)
        of = np.repeat(np.arange(len(ways)), _RINGS)
        zones = in_rig_frame(self.limits.zones, self.subject)
        for zone in zones.allowed:
            within = _within(zone)
            away = np.linalg.norm(within - self.middle, axis=1)
            within, away = within[away > 1.0], away[away > 1.0]
            within, away = (
                within[(away >= low) & (away <= high)],
                away[(away >= low) & (away <= high)],
            )
            of = np.concatenate([of, len(ways) + np.arange(len(within))])
            ways = np.concatenate([ways, (within - self.middle) / away[:, None]])
            places = np.concatenate([places, within])
        keep = np.ones(len(places), dtype=np.bool_)
        if zones.allowed:
            keep &= inside_any(zones.allowed, places)
        keep &= ~inside_any(zones.forbidden, places)
        return ways, of[keep], places[keep]

    @property
    def places(self) -> Floats:
        """The places themselves, (m, 3)."""
        return self._ways[2]

    @cached_property
    def distance_mm(self) -> Floats:
        """Their distances from the centroid, (m,)."""
        return np.asarray(np.linalg.norm(self.places - self.middle, axis=1))

    def _cast(self, beyond_deg: float) -> Bools:
        """What is seen along each direction (d, p), from a usual distance."""
        low, high = self.reach_mm
        usual = min(high, max(low, _USUAL_RADII * self.subject.design_points.radius_mm))
        ways, of, _ = self._ways
        out = np.zeros((len(ways), len(self.points)), dtype=np.bool_)
        used = np.unique(of)
        eyes = self.middle + usual * ways[used]
        limit = min(self.limits.incidence.ray_max_deg + beyond_deg, 90.0)
        at_rest = (rest(self.middle),)
        out[used] = cast_rays(self.points, self.subject.occluder, eyes, limit, at_rest).seen
        return out

    @cached_property
    def may_see(self) -> Bools:
        """What each place, or one beside it, may see, (m, p)."""
        return np.asarray(self._cast(self.between_deg)[self._ways[1]])

    @cached_property
    def useful(self) -> Bools:
        """Places from which anything is seen, (m,)."""
        return np.asarray(self.may_see.sum(axis=1) >= _LEAST_SEEN)

    def _needs(self, limits: Limits) -> Floats:
        """Least distance (m,) from which what is seen is in frame, and sharp where asked for."""
        ways, of, _ = self._ways
        out = np.zeros(len(ways))
        for k in np.unique(of[self.useful]):
            seen = self.points.points_mm[self._seen_along[k]]
            if len(seen) >= _LEAST_SEEN:
                out[k] = better_roll(self.camera, limits, seen, -ways[k], self.middle)[1]
        return np.asarray(out[of])

    @cached_property
    def _seen_along(self) -> Bools:
        return self._cast(0.0)

    @cached_property
    def framed_mm(self) -> Floats:
        """Least distances (m,) at which all that is seen is in frame."""
        bare = replace(self.limits, stand_off=StandOff(), depth_of_field=False)
        return self._needs(bare)

    @cached_property
    def sharp_mm(self) -> Floats:
        """Least distances (m,) at which it is in frame and, where that is a limit, sharp."""
        if not self.limits.depth_of_field:
            return self.framed_mm
        return self._needs(replace(self.limits, stand_off=StandOff()))

    @cached_property
    def farthest_mm(self) -> float:
        """Beyond this no pixel is small enough."""
        gsd = self.limits.gsd_max_mm
        if gsd is None:
            return np.inf
        return gsd * self.camera.focal_length_px + self.subject.design_points.radius_mm

    @cached_property
    def _sharp_anyhow_mm(self) -> Floats:
        """Distances (m,) below which nothing that is seen all about a place is sharp at once.

        However the camera aims, and whatever its roll; zero where nothing is asked.
        """
        ways, of, places = self._ways
        if not self.limits.depth_of_field or self.camera.focus_distance_mm is not None:
            return np.zeros(len(places))
        core = self._cast(-self.between_deg)
        farthest = np.zeros(len(ways))
        np.maximum.at(farthest, of, self.distance_mm)
        used = [k for k in np.unique(of) if core[k].sum() >= _LEAST_SEEN]
        out = np.zeros(len(ways))
        found = [self._aimed(core[k], ways[k], farthest[k]) for k in used]
        if found:
            low, high, facing = (np.concatenate(each) for each in zip(*found, strict=True))
            need = sharp_from_mm(self.camera, low, high) / facing
            first = np.cumsum([0] + [len(each[0]) for each in found])[:-1]
            out[used] = BETWEEN_AIMS * np.minimum.reduceat(need, first)
        return np.asarray(out[of])

    def _aimed(self, seen: Bools, way: Floats, farthest_mm: float) -> tuple[Floats, Floats, Floats]:
        """Least and greatest depth about the middle, and cosine to ``way``, of each aim (a,)."""
        mine = self.points.points_mm[seen] - self.middle
        axes = aims(self.camera, mine, farthest_mm * way)
        return (*depths(mine, axes), -(axes @ way))

    @cached_property
    def standing(self) -> Bools:
        """Places (m,) at which a camera can stand and have all that it sees as the limits ask."""
        far = self.distance_mm <= self.farthest_mm
        near = np.maximum(NEARER * self.sharp_mm, self._sharp_anyhow_mm)
        return np.asarray(self.useful & (self.distance_mm >= near) & far)

    @property
    def scarce(self) -> bool:
        """Whether so few places let a camera stand that a finer look may find them too few."""
        return bool(self.standing.sum() < _FEW * self.useful.sum())


def all_around(step_deg: float) -> Floats:
    """Unit vectors (d, 3), evenly in all directions."""
    count = int(4.0 * np.pi / np.radians(step_deg) ** 2)
    k = np.arange(count) + 0.5
    up, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - up**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), up], axis=1)


def _within(zone: Zone) -> Floats:
    """Places (m, 3) spread over a zone, which may be too small for the grid to hit."""
    grid = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 5)] * 3, indexing="ij"), -1).reshape(-1, 3)
    if isinstance(zone, Box):
        return np.asarray(
            (zone.low_mm + zone.high_mm) / 2.0 + grid * (zone.high_mm - zone.low_mm) / 2.0
        )
    if isinstance(zone, Sphere):
        return np.asarray(
            zone.centre_mm + zone.radius_mm * grid[np.linalg.norm(grid, axis=1) <= 1.0]
        )
    return np.zeros((0, 3))
