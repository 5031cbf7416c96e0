"""What one camera's move does to the whole network, fast enough to try thousands of moves.

The rows of the limits come from the solver's own table. It is asked only for the camera that
moves and those whose limits it shares, on the points that can matter: the outermost ones it
sees and an even sample of the rest. Coverage is counted on all check points. A finished
rig is always judged by :func:`solver.quality.evaluate` on everything.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from geometry.camera import RigCamera
from geometry.subject import Subject
from geometry.surface import SurfacePoints
from solver.constraints.table import constraint_table
from solver.information import normal_matrices
from solver.limits import BaseHeight, Coverage, Limits
from solver.problem import Problem
from solver.quality import Observations
from solver.result import ConstraintRow, Sense

SAMPLE = 500
"""How many check points stand for the others where only means are asked for."""

RIM_SAMPLE = 250
"""How many are watched beside the outermost ones a camera sees, in case it sees more."""

NEAREST = 2
BINDING_SHARE = 0.15
"""A pair of cameras is watched when a limit between them has less slack than this."""

COVERAGE_KEPT = 5e-4
"""Share of the points that building may lose: half of what a plan should at most lose."""


def size_of(row: ConstraintRow) -> float:
    """What a row's slack is compared with: its limit, or its tolerance for an equality."""
    size = abs(row.limit)
    if row.sense is Sense.EQUAL:
        size = max(size, row.slack + abs(row.value - row.limit))
    return max(size, 1e-3)


def relative_slack(row: ConstraintRow) -> float:
    """Slack of a row as a share of its size."""
    return row.slack / size_of(row)


@dataclass(frozen=True, order=True)
class Score:
    """Smaller is better: first the relative breach of all limits, then the cost in mm2.

    ``lack``: how much the limits come closer than the margins asked for, relative too.
    """

    breach: float
    lack: float
    cost_mm2: float


class MountNetwork:
    """Cameras, of which one at a time may be tried elsewhere and then moved."""

    def __init__(self, subject: Subject, limits: Limits, cameras: tuple[RigCamera, ...]) -> None:
        self._subject, self._limits = subject, limits
        self.cameras = list(cameras)
        self.margins: dict[str, float] = {}
        scene = Problem(subject, cameras, limits)
        self._positions = scene.visibility_positions
        self._framing = scene.framing_positions
        self._prior = 1.0 / limits.coverage.unseen_sigma_mm**2
        observations = [Observations.of(scene, position) for position in self._positions]
        hulls = [scene.hull(np.logical_or.reduce([s.visible[i] for s in observations])) for i in
                 range(len(cameras))]  # fmt: skip
        self._depth_points = [np.concatenate([p.points(h) for p in self._framing]) for h in hulls]
        self._framed = np.stack([s.framed for s in observations], axis=1)
        self._thin = _thinned(subject, SAMPLE)
        self._outer = [_thinned(subject, RIM_SAMPLE, hull) for hull in hulls]
        self._info = np.stack([self._information(c) for c in cameras])
        self._local = replace(limits, coverage=Coverage((), limits.coverage.unseen_sigma_mm))
        names = [c.name for c in cameras]
        self._ends: dict[str, tuple[int, ...]] = {n: (i,) for i, n in enumerate(names)}
        for i, k in permutations(range(len(names)), 2):
            self._ends[f"{names[i]}-{names[k]}"] = (i, k)
        self._partners, self._company = self._find_partners(scene)
        self._count: Ints = self._framed.sum(axis=0)
        self._total: Floats = self._info.sum(axis=0)
        self._kept = [_share(self._count, t.views) for t in limits.coverage.tiers]

    def focused(self, index: int, camera: RigCamera) -> RigCamera:
        """The camera with its focus where the nearest and farthest point are equally sharp."""
        kind, points = camera.camera, self._depth_points[index]
        if kind.focus_distance_mm is not None or not self._limits.depth_of_field or camera.fixed:
            return camera
        if not len(points):
            return camera
        depth = (points - camera.pose.position_rig_mm) @ camera.pose.axis_rig
        near, far = float(depth.min()), float(depth.max())
        if near <= 0.0:
            return camera
        even = 2.0 * near * far / (near + far)
        return replace(camera, focus_distance_mm=max(kind.min_focus_distance_mm, even))

    def rows(self, index: int, camera: RigCamera) -> dict[str, ConstraintRow]:
        """Rows that speak of the camera, were it elsewhere, by name."""
        who = self._company[index]
        cameras = tuple(camera if k == index else self.cameras[k] for k in who)
        limits = self._local if len(who) == len(self.cameras) else _without_means(self._local)
        scene = Problem(self._outer[index], cameras, limits)
        alone = Problem(self._outer[index], (camera,), limits)
        visible = []
        for position in self._positions:
            # What the others see is not asked for: their own rows do not change.
            seen = np.zeros((len(who), len(scene.subject.check_points)), dtype=bool)
            seen[who.index(index)] = Observations.of(alone, position).visible[0]
            visible.append(seen)
        table = constraint_table(scene, visible, ())
        return {row.name: row for row in table if self._speaks_of(row, index)}

    def _speaks_of(self, row: ConstraintRow, index: int) -> bool:
        """Whether a row is about this camera and is true although others were left out."""
        ends = self._ends.get(row.subject)
        if ends is None or index not in ends:
            return ends is None
        # Whose nearest neighbour was left out would seem to have this one as its nearest.
        return row.family != "base_height_neighbour" or ends[0] in self._partners[index]

    def score(self, index: int, camera: RigCamera) -> Score:
        """The network with one camera elsewhere."""
        breach = lack = 0.0
        for row in self.rows(index, camera).values():
            size = size_of(row)
            if not row.satisfied:
                breach -= row.slack / size
            lack += max(0.0, self.margins.get(row.name, 0.0) - row.slack) / size
        breach += self._coverage_breach(self._views(index, camera))
        cost = self._cost(index, self._information(camera))
        return Score(round(breach, 9), round(lack, 4), cost)

    def broken(self, index: int, camera: RigCamera) -> str:
        """The limit that one camera elsewhere breaks most; empty when it breaks none."""
        worst, name = 0.0, ""
        for row in self.rows(index, camera).values():
            if not row.satisfied and relative_slack(row) < worst:
                worst, name = relative_slack(row), row.name
        if name:
            return name
        views = self._views(index, camera)
        for tier in self._limits.coverage.tiers:
            if _share(views, tier.views) < tier.share:
                return f"coverage_{tier.views}/all"
        return ""

    def move(self, index: int, camera: RigCamera) -> None:
        """Put a camera elsewhere for good."""
        self.cameras[index] = camera
        framed, info = self._sees(camera), self._information(camera)
        self._count += framed.astype(np.int64) - self._framed[index]
        self._total += info - self._info[index]
        self._framed[index], self._info[index] = framed, info

    def _views(self, index: int, camera: RigCamera) -> Ints:
        """How many cameras see each point, (positions, q), with one of them elsewhere."""
        return np.asarray(self._count - self._framed[index] + self._sees(camera))

    def _coverage_breach(self, views: Ints) -> float:
        """Relative breach of the limits of coverage, and of what the design reached."""
        breach = 0.0
        for tier, kept in zip(self._limits.coverage.tiers, self._kept, strict=True):
            wanted = max(tier.share, kept - COVERAGE_KEPT)
            breach += max(0.0, wanted - _share(views, tier.views)) / wanted
        return breach

    def _sees(self, camera: RigCamera) -> Bools:
        scene = Problem(self._subject, (camera,), self._limits)
        return np.stack([Observations.of(scene, p).framed[0] for p in self._positions])

    def _information(self, camera: RigCamera) -> Floats:
        """What a camera adds to the normal matrix of each sampled point, (p, 3, 3), 1/mm2."""
        scene = Problem(self._thin, (camera,), self._limits)
        seen = Observations.of(scene, self._positions[0]).framed
        state = scene.unknowns.state(scene.start_values())
        points = scene.scaled(self._thin.check_points.points_mm)
        found = normal_matrices(state, points, seen * scene.ray_weight[:, None], 0.0)
        return np.asarray(found / scene.length_mm**2)

    def _cost(self, index: int, own: Floats) -> float:
        total = self._total - self._info[index] + own
        total[:, range(3), range(3)] += self._prior
        return float(np.linalg.norm(np.linalg.inv(total), axis=(1, 2)).mean())

    def _find_partners(self, scene: Problem) -> tuple[list[list[int]], list[list[int]]]:
        """Each camera's partners, and the company in which its rows come out right.

        Partners are the camera itself, its nearest ones, and those it shares a tight limit with.
        The company holds their nearest ones too.
        """
        count = len(self.cameras)
        everyone = list(range(count))
        if _speaks_of_all(self._limits):
            return [everyone] * count, [everyone] * count
        centres = np.stack([c.pose.position_rig_mm for c in self.cameras])
        away = np.linalg.norm(centres[:, None] - centres[None], axis=2)
        near = away <= np.sort(away, axis=1)[:, [min(NEAREST, count - 1)]]
        linked = near | near.T
        local = Problem(self._thin, scene.cameras, self._local)
        visible = [Observations.of(local, position).visible for position in self._positions]
        for row in constraint_table(local, visible, ()):
            ends = self._ends.get(row.subject, ())
            if len(ends) == 2 and relative_slack(row) < BINDING_SHARE:
                linked[ends] = linked[ends[::-1]] = True
        company = linked | (linked.astype(int) @ near.astype(int) > 0)
        return [_true(row) for row in linked], [_true(row) for row in company]


def _true(row: Bools) -> list[int]:
    return [int(k) for k in np.flatnonzero(row)]


def _share(views: Ints, enough: int) -> float:
    """Share of the points with so many views, in the worst head position."""
    return float((views >= enough).mean(axis=-1).min())


def _speaks_of_all(limits: Limits) -> bool:
    means = (limits.base_height.mean_min, limits.base_height.mean_max)
    return limits.symmetry is not None or limits.spacing is not None or any(
        m is not None for m in means
    )  # fmt: skip


def _without_means(limits: Limits) -> Limits:
    base = limits.base_height
    pairs = BaseHeight(min=base.min, max=base.max, neighbour_max=base.neighbour_max)
    return replace(limits, base_height=pairs, symmetry=None, spacing=None)


def _thinned(subject: Subject, sample: int, more_mm: Floats | None = None) -> Subject:
    """The subject with an even sample of its check points, and those that are given as well."""
    points = subject.check_points
    rows = np.zeros(len(points), dtype=bool)
    rows[:: max(1, len(points) // sample)] = True
    if more_mm is not None:
        where = {tuple(p): k for k, p in enumerate(points.points_mm)}
        rows[[where[tuple(p)] for p in more_mm]] = True
    kept = SurfacePoints(points.points_mm[rows], points.normals[rows])
    return Subject(subject.design_points, kept, subject.occluder)
