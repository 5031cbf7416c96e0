"""Candidate poses all around the subject, with what each sees and how much it would tell."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from common.errors import CancelledError
from common.progress import CancelToken, NeverCancelled
from geometry.arrays import Bools, Floats, Ints
from geometry.camera import Camera, RigCamera
from geometry.frames import Pose, look_at_rotation
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from solver.constraints.builders.bodies import zone_constraints
from solver.coverage.views import NEAR, in_frame
from solver.coverage.visibility import cast_rays
from solver.information import ray_information
from solver.limits import Limits
from solver.motion import visibility_positions
from solver.problem import Problem, camera_at
from solver.search.matches import Matches
from solver.starts import better_roll
from solver.workers import Report, Workers, silent

STEP_DEG = 6.0
"""Angle between neighbouring candidate directions: finer ones are left to the continuous solve."""

WIDEST_DEG = 80.0
"""Candidates stand up to this far from the mean normal of the subject."""

HARDEST, OTHERS = 300, 300
"""Check points that the search weighs: those that fewest candidates see, which decide a network,
and some of all others, which count for more. The continuous solve and the evaluation use all."""

_LEAST_SEEN = 3
_ROOM = 1.01
"""A candidate stands this much farther than it must, so that a solve begins inside the limits."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Cameras that could stand somewhere, the rig's fixed ones last.

    ``information`` (m, 6, p) of each camera's ray to each point, in 1/mm2 (xx, yy, zz, xy, xz,
    yz), zero where it does not see it; ``seen`` (m, p); ``share`` (p,) of all check points that
    each point stands for; ``position_mm`` (m, 3); ``distance_mm`` (m,) to the centroid;
    ``fixed`` how many of the last are there already; ``matches`` what a matcher could use of
    their views, where the limits ask for it.
    """

    cameras: tuple[RigCamera, ...]
    information: Floats
    seen: Bools
    share: Floats
    prior: float
    position_mm: Floats
    distance_mm: Floats
    fixed: int
    matches: Matches | None = None

    def __len__(self) -> int:
        return len(self.cameras)

    @property
    def free(self) -> int:
        """How many of the first are to be chosen from."""
        return len(self.cameras) - self.fixed

    @property
    def base_height(self) -> Floats:
        """Base/height ratio (m, m) of all pairs (Eq 9)."""
        gap = self.position_mm[:, None] - self.position_mm[None]
        height = self.distance_mm[:, None] + self.distance_mm[None]
        return np.asarray(2.0 * np.linalg.norm(gap, axis=2) / height)

    @property
    def gap_mm(self) -> Floats:
        """Distances (m, m) of the projection centres."""
        return np.asarray(
            np.linalg.norm(self.position_mm[:, None] - self.position_mm[None], axis=2)
        )


def directions(facing: Floats, step_deg: float = STEP_DEG) -> Floats:
    """Unit vectors (m, 3) about ``facing`` (3,), ``step_deg`` apart, up to ``WIDEST_DEG`` away.

    Rings of latitude about ``facing``, so that no direction is favoured.
    """
    side = np.cross(facing, [0.0, 0.0, 1.0])
    if np.linalg.norm(side) < 1e-6:
        side = np.array([1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    up = np.cross(side, facing)
    out = [facing]
    for away in np.radians(np.arange(step_deg, WIDEST_DEG + 1e-9, step_deg)):
        count = round(2.0 * np.pi * np.sin(away) / np.radians(step_deg))
        turn = 2.0 * np.pi * np.arange(count) / count
        ring = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up
        out += list(np.cos(away) * facing + np.sin(away) * ring)
    return np.array(out)


def directions_about(centres: Floats, step_deg: float) -> Floats:
    """Unit vectors (13 m, 3): those given (m, 3), and two rings of six about each.

    The rings are ``step_deg`` and twice that away, turned by half a step from each other.
    """
    out = []
    for centre in centres:
        side = np.cross(centre, np.eye(3)[np.abs(centre).argmin()])
        side /= np.linalg.norm(side)
        up = np.cross(side, centre)
        out.append(centre)
        for ring in (1, 2):
            away, turn = np.radians(ring * step_deg), np.pi * (np.arange(6) + 0.5 * ring) / 3.0
            across = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up
            out += list(np.cos(away) * centre + np.sin(away) * across)
    return np.array(out)


@dataclass(frozen=True, eq=False)
class _Placing:
    """Cameras to be placed in the directions ``outward`` (m, 3); see :func:`placed`.

    The result is the camera of each direction that sees enough, and how many of them see each check
    point (p,) from a usual distance. ``closely``: what they see is looked at again from where they
    stand, so that a solve begins inside the limits.
    """

    index: int
    subject: Subject
    camera: Camera
    limits: Limits
    outward: Floats
    closely: bool

    def run(self, _report: Report, cancel: CancelToken) -> tuple[list[RigCamera], Ints]:
        """See :class:`solver.workers.Job`."""
        points = self.subject.check_points
        guess = self._usual_distance_mm()
        found: list[RigCamera] = []
        often = np.zeros(len(points), dtype=np.int64)
        for direction in self.outward:
            if cancel.is_set():
                raise CancelledError
            sees = self._sight(guess * direction + self._middle)
            if sees.sum() < _LEAST_SEEN:
                continue
            often += sees
            pose = self._pose(sees, direction)
            if self.closely:
                sees |= self._sight(pose.position_rig_mm)
                pose = self._pose(sees, direction)
            found.append(camera_at(self.camera, "candidate", pose, points.points_mm[sees]))
        return found, often

    @cached_property
    def _middle(self) -> Floats:
        return self.subject.design_points.centroid_mm

    def _usual_distance_mm(self) -> float:
        stand_off, radius = self.limits.stand_off, self.subject.design_points.radius_mm
        return min(stand_off.max_mm or 10.0 * radius, max(stand_off.min_mm or 0.0, 6.0 * radius))

    def _sight(self, eye_mm: Floats) -> Bools:
        # A little beyond the limit of incidence: what a short move would bring into view.
        points, eyes = self.subject.check_points, eye_mm[None]
        return np.asarray(_sight(points, self.subject, self.limits, eyes, NEAR.framed_deg)[0])

    def _pose(self, sees: Bools, away: Floats) -> Pose:
        seen_mm = self.subject.check_points.points_mm[sees]
        roll, nearest = better_roll(self.camera, self.limits, seen_mm, -away, self._middle)
        low = self.limits.stand_off.min_mm or 0.0
        high = self.limits.stand_off.max_mm or np.inf
        distance = float(np.clip(_ROOM * nearest, low, high))
        return Pose(self._middle + distance * away, look_at_rotation(np.zeros(3), -away, roll))


@dataclass(frozen=True, eq=False)
class Placed:
    """Cameras that could stand somewhere, and how many see each check point (p,) from there."""

    cameras: tuple[RigCamera, ...]
    often: Ints


def placed(
    subject: Subject,
    camera: Camera,
    limits: Limits,
    cancel: CancelToken | None = None,
    step_deg: float = STEP_DEG,
    outward: Floats | None = None,
    workers: Workers | None = None,
) -> Placed:
    """Cameras around the subject, each as near as frame and focus allow for what it sees.

    They stand ``step_deg`` apart all around it, or in the directions ``outward`` (m, 3). They aim
    at the centroid, level or upright, whichever lets them stand closer. Those that a zone
    forbids are left out. ``workers`` share the work, and do not change what comes of it. Raises
    :class:`CancelledError` soon after ``cancel`` is set.
    """
    workers = workers or Workers()
    closely = outward is not None
    if outward is None:
        outward = directions(_facing(subject), step_deg)
    jobs = [
        _Placing(k, subject, camera, limits, part, closely)
        for k, part in enumerate(np.array_split(outward, workers.count))
    ]
    found = workers.run(jobs, silent, cancel or NeverCancelled())
    cameras = _where_allowed(subject, limits, [c for some, _ in found for c in some])
    cameras = [replace(c, name=f"at{k}") for k, c in enumerate(cameras)]
    return Placed(tuple(cameras), np.sum([often for _, often in found], axis=0))


def candidates(
    subject: Subject, limits: Limits, around: Placed, fixed: tuple[RigCamera, ...] = ()
) -> Candidates:
    """The cameras that were placed ``around`` the subject, and the ``fixed`` ones, weighed."""
    chosen, share = _weighed_points(around.often)
    whole = replace(subject, design_points=subject.check_points.subset(chosen))
    middle = subject.design_points.centroid_mm
    return _weighed(whole, share, limits, (*around.cameras, *fixed), len(fixed), middle)


def _facing(subject: Subject) -> Floats:
    """Mean normal (3,) of the subject, or towards the cameras where normals cancel out."""
    mean = subject.design_points.normals.mean(axis=0)
    length = float(np.linalg.norm(mean))
    return np.asarray(mean / length if length > 1e-6 else np.array([0.0, -1.0, 0.0]))


def _weighed_points(often: Ints) -> tuple[Ints, Floats]:
    """Which points are weighed, and the share of all that each stands for, by how often seen.

    Their order is random, so that every so many of them are a fair sample.
    """
    order = np.argsort(often, kind="stable")
    hard, others = order[:HARDEST], np.sort(order[HARDEST:])
    others = others[:: max(1, len(others) // OTHERS)]
    weight = np.ones(len(hard) + len(others))
    weight[len(hard) :] = (len(often) - len(hard)) / max(1, len(others))
    chosen = np.concatenate([hard, others])
    back = np.argsort(chosen, kind="stable")
    return chosen[back], weight[back] / len(often)


def _sight(
    points: SurfacePoints,
    subject: Subject,
    limits: Limits,
    centres_mm: Floats,
    beyond_deg: float = 0.0,
) -> Bools:
    """Which points (p) are seen from which centres (m, 3), head at rest and moved."""
    positions = visibility_positions(limits.motion, subject.design_points.centroid_mm)
    limit = min(limits.incidence.ray_max_deg + beyond_deg, 90.0)
    return cast_rays(points, subject.occluder, centres_mm, limit, positions).seen


def _where_allowed(subject: Subject, limits: Limits, cameras: list[RigCamera]) -> list[RigCamera]:
    """The cameras whose bodies keep to the zones."""
    if not cameras or not (limits.zones.allowed or limits.zones.forbidden):
        return cameras
    problem = Problem(subject, tuple(cameras), limits)
    state = problem.unknowns.state(problem.start_values())
    broken = np.zeros(len(cameras), dtype=np.bool_)
    for rows in zone_constraints(problem, state):
        who = rows.block.columns[:, 0] // 7
        broken[who[rows.block.violation(state) > 0.0]] = True
    return [c for c, out in zip(cameras, broken, strict=True) if not out]


def _weighed(
    subject: Subject,
    share: Floats,
    limits: Limits,
    cameras: tuple[RigCamera, ...],
    fixed: int,
    middle: Floats,
) -> Candidates:
    if not cameras:
        empty = np.zeros((0, 6, len(share)))
        nobody = empty[:, 0] > 0.0
        return Candidates((), empty, nobody, share, 0.0, np.zeros((0, 3)), np.zeros(0), 0)
    problem = Problem(subject, cameras, limits)
    centres = np.stack([c.pose.position_rig_mm for c in cameras])
    seen = _sight(subject.design_points, subject, limits, centres)
    for i, camera in enumerate(cameras):
        seen[i] &= in_frame(camera, subject.design_points.points_mm)
    state = problem.unknowns.state(problem.start_values())
    weight = seen * problem.ray_weight[:, None]
    information = ray_information(state, problem.points, weight) / problem.length_mm**2
    distance = np.linalg.norm(centres - middle, axis=1)
    prior = problem.prior / problem.length_mm**2
    matches = Matches.of(problem, seen, share)
    return Candidates(cameras, information, seen, share, prior, centres, distance, fixed, matches)
