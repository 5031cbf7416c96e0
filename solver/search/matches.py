"""Matchable pairs among candidates: which networks a matcher could hold together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.sparse.csgraph import connected_components

from geometry.arrays import Bools, Floats, Ints
from solver.coverage.matchable import MatchableViews
from solver.coverage.visibility import cosines
from solver.problem import Problem
from solver.quality import is_sharp

_KEPT = 64
"""Candidates whose matches with all others are kept: those that networks come back to."""

_SPARE = 0.003
"""Asked for beyond each share: a network is judged on other points than it is chosen by."""

_PER_RULE = 0.005
"""A share that lacks counts as one broken rule for each so much of it."""


@dataclass(frozen=True, eq=False)
class Matches:
    """The views of candidates that a matcher could use; ``share`` (p,) is what points stand for."""

    views: MatchableViews
    share: Floats

    @classmethod
    def of(cls, problem: Problem, seen: Bools, share: Floats) -> Matches | None:
        """Among the design points of the candidates' problem, ``seen`` (m, p); None if unasked."""
        matching, source = problem.limits.matching, problem.subject.design_points
        if not matching.required:
            return None
        centres = np.stack([c.pose.position_rig_mm for c in problem.cameras])
        depth = np.stack([c.pose.to_camera(source.points_mm)[:, 2] for c in problem.cameras])
        steep = np.cos(np.radians(matching.max_incidence_deg))
        usable = seen & np.stack([cosines(source, eye) >= steep for eye in centres])
        usable &= np.stack([is_sharp(c, z) for c, z in zip(problem.cameras, depth, strict=True)])
        focal = np.array([c.camera.focal_length_px for c in problem.cameras])
        pixel = depth / focal[:, None]
        can = usable.sum(axis=0) > 1
        weight = np.where(can, share, 0.0)
        views = MatchableViews(matching, usable, centres, source.points_mm, pixel)
        return cls(views, weight / max(float(weight.sum()), 1e-12))

    @cached_property
    def _with(self) -> Callable[[int], Bools]:
        """Points (m, p) that each other candidate can match with one."""
        everybody = np.arange(len(self.views.usable))
        points = np.arange(self.views.usable.shape[1])

        @lru_cache(maxsize=_KEPT)
        def found(camera: int) -> Bools:
            # A camera that cannot use a point matches nothing there, whatever the other can.
            out = self.views.with_others(camera, everybody, points) & self.views.usable[camera]
            out[camera] = False
            return np.asarray(out)

        return found

    def broken_with_each(self, rest: Ints) -> Ints:
        """Groups too many and shares that lack, as rules broken with each candidate added, (m,)."""
        m, p = self.views.usable.shape
        if len(rest) == 0:
            return np.zeros(m, dtype=np.int64)
        count, joined = np.zeros((m, p), dtype=np.int16), np.zeros((m, len(rest)), dtype=np.bool_)
        for k, camera in enumerate(rest):
            matched = self._with(int(camera))
            count += matched
            joined[:, k] = matched @ self.share >= self.views.matching.least_shared
        # Each pair within the network was counted from both of its ends.
        count += (count[rest].sum(axis=0) // 2).astype(np.int16)
        out = self._groups(joined, rest) - 1
        for tier in self.views.matching.tiers:
            lack = min(tier.share + _SPARE, 1.0) - (count >= tier.pairs) @ self.share
            out += np.ceil(np.maximum(lack - 1e-9, 0.0) / _PER_RULE).astype(np.int64)
        return np.asarray(out)

    @staticmethod
    def _groups(joined: Bools, rest: Ints) -> Ints:
        """How many groups (m,) the network and each candidate are, joined (m, k) to its cameras."""
        count, label = connected_components(joined[rest], directed=False)
        touched = np.zeros((len(joined), count), dtype=np.bool_)
        for k, group in enumerate(label):
            touched[:, group] |= joined[:, k]
        return np.asarray(count - touched.sum(axis=1) + 1)
