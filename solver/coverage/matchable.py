"""Matchable pairs of a network: what dense matching can make of what its cameras see."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.sparse.csgraph import connected_components

from geometry.arrays import Bools, Floats, Ints
from geometry.raycast import Occluder
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from solver.coverage.visibility import Visibility, cast_rays
from solver.limits import Limits
from solver.matching import Matching
from solver.motion import HeadPosition, rest
from solver.problem import Problem
from solver.variables import NetworkState
from solver.zones import in_rig_frame, inside_any

_STEPS_DEG = (18.0, 6.0)
"""How far apart the places are that cameras could take: fine where the coarse ones see nothing."""

_RADII = 6.0
_WIDEST_RAD = np.radians(80.0)
"""At a usual distance, so many radii, and up to 80 degrees from where the subject faces."""


@dataclass(frozen=True, eq=False)
class MatchableViews:
    """The views of a network that a matcher could use, paired.

    ``usable`` (n, q): seen, in frame, sharp and within the incidence; ``centres_mm`` (n, 3);
    ``points_mm`` (q, 3); ``pixel_mm`` (n, q) size of a pixel at each point.
    """

    matching: Matching
    usable: Bools
    centres_mm: Floats
    points_mm: Floats
    pixel_mm: Floats

    @cached_property
    def _counted(self) -> tuple[Ints, Ints]:
        """Pairs of each point (q,), points of each pair (n, n)."""
        n, q = self.usable.shape
        of_point, of_pair = np.zeros(q, dtype=np.int64), np.zeros((n, n), dtype=np.int64)
        for i in range(n - 1):
            seen = np.flatnonzero(self.usable[i])
            pairs = self.with_others(i, np.arange(i + 1, n), seen)
            of_point[seen] += pairs.sum(axis=0)
            of_pair[i, i + 1 :] = of_pair[i + 1 :, i] = pairs.sum(axis=1)
        return of_point, of_pair

    def with_others(self, camera: int, others: Ints, points: Ints) -> Bools:
        """Which ``others`` (m,) match ``points`` (k,), usable to a camera, with it, (m, k)."""
        rays = self._rays
        cosine = np.einsum("mkc,kc->mk", rays[others][:, points], rays[camera, points])
        one, other = self.pixel_mm[camera, points], self.pixel_mm[others][:, points]
        ratio = self.matching.max_scale_ratio
        alike = (other <= ratio * one) & (one <= ratio * other)
        near = cosine >= np.cos(np.radians(self.matching.max_angle_deg))
        return np.asarray(self.usable[others][:, points] & near & alike)

    @cached_property
    def _rays(self) -> Floats:
        rays = self.centres_mm[:, None] - self.points_mm[None]
        return np.asarray(rays / np.maximum(np.linalg.norm(rays, axis=2, keepdims=True), 1e-12))

    @property
    def pairs_of_point(self) -> Ints:
        """How many pairs of cameras can match each point, (q,)."""
        return self._counted[0]

    @property
    def shared(self) -> Floats:
        """Share of the points that each pair of cameras can match, (n, n), 0 on the diagonal."""
        return np.asarray(self._counted[1] / max(1, len(self.points_mm)))

    def share(self, pairs: int, reachable: Bools) -> float:
        """Share in so many pairs or more of the points that can be matched (q,)."""
        return float((self.pairs_of_point[reachable] >= pairs).mean()) if reachable.any() else 0.0

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Cameras that hang together by the surface that they share, the largest group first."""
        _, label = connected_components(self.shared >= self.matching.least_shared, directed=False)
        found = [tuple(np.flatnonzero(label == k).tolist()) for k in range(label.max() + 1)]
        return tuple(sorted(found, key=lambda g: (-len(g), g)))


@dataclass(frozen=True, eq=False)
class Matchable:
    """What can be matched of the check points, and by whom. Worked out when it is asked for.

    ``positions`` are the views in every head position, at rest first.
    """

    subject: Subject
    limits: Limits
    positions: tuple[MatchableViews, ...]

    @property
    def pairs_of_point(self) -> Ints:
        """How many pairs of cameras can match each point, (q,), the head at rest."""
        return self.positions[0].pairs_of_point

    @property
    def shared(self) -> Floats:
        """Share of the points that each pair can match, (n, n), the head at rest."""
        return self.positions[0].shared

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Cameras that hang together, in the worst head position."""
        return max((v.groups for v in self.positions), key=len)

    @cached_property
    def reachable(self) -> Bools:
        """Which points any pair could match, wherever it stood, (q,)."""
        matched = np.logical_or.reduce([v.pairs_of_point > 0 for v in self.positions])
        return np.asarray(reachable(self.subject, self.limits) | matched)

    @property
    def reachable_share(self) -> float:
        """Share of the points that any pair could match."""
        return float(self.reachable.mean())

    def share(self, pairs: int) -> float:
        """Share in so many pairs or more, of the points that can be; the worst head position."""
        return min(v.share(pairs, self.reachable) for v in self.positions)


def lacks(
    problem: Problem, state: NetworkState, position: HeadPosition, found: Visibility
) -> dict[str, float]:
    """By how much each limit on matching is missed in one head position: shares, and groups.

    ``found`` is what the cameras see of the check points; what they see they have in frame and
    sharp, which other limits are for.
    """
    matching, subject = problem.limits.matching, problem.subject
    if not matching.required:
        return {}
    centres = state.centre * problem.length_mm + problem.origin_mm
    points = position.points(subject.check_points.points_mm)
    depth = np.einsum("npk,nk->np", points[None] - centres[:, None], state.axis)
    focal = np.array([c.camera.focal_length_px for c in problem.cameras])
    usable = found.seen & (found.cosine >= np.cos(np.radians(matching.max_incidence_deg)))
    views = MatchableViews(matching, usable, centres, points, depth / focal[:, None])
    can = reachable(subject, problem.limits) | (views.pairs_of_point > 0)
    out = {f"matchable_{t.pairs}": t.share - views.share(t.pairs, can) for t in matching.tiers}
    out["groups"] = float(len(views.groups) - 1)
    return {name: lack for name, lack in out.items() if lack > 0.0}


def reachable(subject: Subject, limits: Limits) -> Bools:
    """Points (q,) that two places which a camera may take could match."""
    middle, radius = subject.check_points.centroid_mm, subject.check_points.radius_mm
    far = limits.stand_off.max_mm or np.inf
    distance = min(far, max(limits.stand_off.min_mm or 0.0, _RADII * radius))
    # Places nearer to each other than the fine grid exist, though none of its pairs is.
    widest = max(limits.matching.max_angle_deg, 1.5 * _STEPS_DEG[-1])
    matching = replace(limits.matching, max_angle_deg=widest)
    steepest = min(matching.max_incidence_deg, limits.incidence.ray_max_deg)
    zones = in_rig_frame(limits.zones, subject)
    allowed, forbidden = zones.allowed, zones.forbidden
    out = np.zeros(len(subject.check_points), dtype=np.bool_)
    for step_deg in (s for s in _STEPS_DEG if s <= max(matching.max_angle_deg, _STEPS_DEG[-1])):
        eyes = middle + distance * _outward(subject, step_deg)
        keep = np.ones(len(eyes), dtype=np.bool_) if not allowed else inside_any(allowed, eyes)
        eyes = eyes[keep & ~inside_any(forbidden, eyes)]
        left = np.flatnonzero(~out)
        if len(left):
            points = left.tobytes(), eyes.tobytes()
            scene = subject.check_points, subject.occluder
            out[left] = _matched_from(*scene, matching, steepest, *points)
    return out


def _outward(subject: Subject, step_deg: float) -> Floats:
    """Directions (m, 3) spread evenly over the side to which the subject faces."""
    count = int(4.0 * np.pi / np.radians(step_deg) ** 2)
    k = np.arange(count) + 0.5
    up, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - up**2)
    every = np.stack([flat * np.cos(turn), flat * np.sin(turn), up], axis=1)
    facing = subject.check_points.normals.mean(axis=0)
    length = float(np.linalg.norm(facing))
    # A subject that faces everywhere is looked at from everywhere.
    return every if length < 0.1 else every[every @ facing >= length * np.cos(_WIDEST_RAD)]


@lru_cache(maxsize=16)
def _matched_from(
    check: SurfacePoints,
    occluder: Occluder,
    matching: Matching,
    steepest_deg: float,
    points: bytes,
    eyes: bytes,
) -> Bools:
    """Which check points (k int64) two of the ``eyes`` (m, 3 doubles) could match, (k,).

    Kept: a design and all that is asked of it afterwards ask for the same again.
    """
    places, source = np.frombuffer(eyes).reshape(-1, 3), check.subset(np.frombuffer(points, int))
    at_rest = (rest(source.centroid_mm),)
    seen = cast_rays(source, occluder, places, steepest_deg, at_rest).seen
    views = MatchableViews(matching, seen, places, source.points_mm, np.ones(seen.shape))
    out = np.zeros(len(source), dtype=np.bool_)
    for i in range(len(places) - 1):
        # One partner is enough, so points that have one are not looked at again.
        left = np.flatnonzero(seen[i] & ~out)
        if len(left):
            out[left] = views.with_others(i, np.arange(i + 1, len(places)), left).any(axis=0)
    out.flags.writeable = False
    return out
