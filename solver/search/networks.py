"""Networks of candidates: what one costs, growing it by the best view, exchanging its views."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.arrays import Bools, Floats, Ints
from solver.information import covariance_norms
from solver.limits import Limits
from solver.search.candidates import Candidates
from solver.search.sight import in_each_others_view

_AT_A_TIME = 24
"""Candidates weighed at a time: what a few hundred points of them take stays in the cache."""

_COVERAGE_WEIGHT = 30.0
"""A share of points that lack views costs this much times that share, in units of the cost."""


ROUGH = 1e-4
"""Costs by which candidates are ranked are true to this share. They are summed in single precision
(6e-8), of which the determinant of a point with one view loses up to three digits."""

_LEAST_PRIOR = 1e-4
"""Of a ray's information; below it the determinant would lose too much."""


@dataclass(frozen=True, eq=False)
class _Rough:
    """What candidates tell in single precision, in units of the most that one of them tells.

    It halves the memory that is gone through, which is what weighing candidates takes its time by.
    """

    information: Floats
    seen: Floats
    share: Floats
    prior: float
    unit: float

    @classmethod
    def of(cls, pool: Candidates) -> _Rough:
        """Of all candidates; in double precision where single would not do."""
        most = max(float(pool.information[:, :3].max(initial=0.0)), pool.prior)
        kind = np.float32 if pool.prior >= _LEAST_PRIOR * most else np.float64
        return cls(
            (pool.information / most).astype(kind),
            pool.seen.astype(kind),
            pool.share.astype(kind),
            pool.prior / most,
            most,
        )


@dataclass(frozen=True, eq=False)
class Search:
    """Candidates under limits: which networks are allowed, and what each costs.

    A network is an array of candidate indices. Its score is a pair: how many rules about pairs
    of cameras it breaks, then the mean norm of the covariances (mm2), raised where coverage
    falls short of its tiers.
    """

    candidates: Candidates
    limits: Limits

    @cached_property
    def too_close(self) -> Bools:
        """Pairs (m, m) that no network may hold: base/height, bodies, one in the other's view."""
        limit, pool = self.limits.base_height, self.candidates
        ratio = pool.base_height
        out = np.zeros(ratio.shape, dtype=np.bool_)
        if limit.min is not None:
            out |= ratio < limit.min
        if limit.max is not None:
            out |= ratio > limit.max
        if self.limits.body_clearance_mm is not None:
            reach = np.array([np.linalg.norm(c.camera.body.size_mm) / 2.0 for c in pool.cameras])
            out |= pool.gap_mm < reach[:, None] + reach[None] + self.limits.body_clearance_mm
        if self.limits.sight_line_clearance_mm is not None:
            out |= in_each_others_view(pool.cameras, self.limits.sight_line_clearance_mm)
        # What stands already is not for the search to judge: every network has it.
        out[pool.free :, pool.free :] = False
        np.fill_diagonal(out, val=True)
        return out

    @cached_property
    def near(self) -> Bools | None:
        """Pairs (m, m) that are neighbours in the sense of the limits; None without that limit."""
        limit = self.limits.base_height.neighbour_max
        if limit is None:
            return None
        out = self.candidates.base_height <= limit
        np.fill_diagonal(out, val=False)
        return np.asarray(out)

    def score(self, network: Ints) -> tuple[int, float]:
        """Rules broken and cost of one network."""
        return self.broken(network), self._cost(network)

    def broken(self, network: Ints) -> int:
        """How many rules about its pairs of cameras one network breaks."""
        if self.candidates.matches is not None:
            return int(self._broken_with_each(network[:-1])[network[-1]])
        among = self.too_close[network][:, network]
        broken = int(np.triu(among, 1).sum())
        # One camera alone has no neighbour that could be too far away.
        if self.near is not None and len(network) > 1:
            broken += int((~self.near[network][:, network].any(axis=1)).sum())
        return broken

    def _cost(self, network: Ints) -> float:
        pool = self.candidates
        entries = pool.information[network].sum(axis=0)
        entries[:3] += pool.prior
        cost = covariance_norms(entries) @ pool.share
        return float(cost * self._shortfall_factor(pool.seen[network].sum(axis=0)))

    def scores_with_each(self, rest: Ints, at_least: int = 1) -> tuple[Ints, Floats]:
        """Rules broken (m,) and cost (m,) of the network ``rest`` with each free candidate added.

        The cost is infinite where more rules are broken than by the ``at_least`` best, and rounded
        to :data:`ROUGH`.
        """
        pool, rough = self.candidates, self._rough
        broken = self._broken_with_each(rest)
        free = broken[: pool.free]
        most = np.partition(free, min(at_least, len(free)) - 1)[min(at_least, len(free)) - 1]
        cost = np.full(len(pool), np.inf)
        worth = np.flatnonzero(free <= most)
        base = rough.information[rest].sum(axis=0)
        base[:3] += rough.prior
        for first in range(0, len(worth), _AT_A_TIME):
            some = worth[first : first + _AT_A_TIME]
            entries = rough.information[some]
            entries += base
            cost[some] = covariance_norms(entries) @ rough.share / rough.unit
        cost[worth] *= 1.0 + _COVERAGE_WEIGHT * self._lack_with_each(rest)[worth]
        return broken, cost

    def costs_without(self, network: Ints, places: Ints) -> Floats:
        """Cost (k,) of the network without the camera at each of its ``places`` (k,)."""
        pool = self.candidates
        whole = pool.information[network].sum(axis=0)
        whole[:3] += pool.prior
        count = pool.seen[network].sum(axis=0)
        cost = np.empty(len(places))
        for first in range(0, len(places), _AT_A_TIME):
            some = network[places[first : first + _AT_A_TIME]]
            norms = covariance_norms(whole - pool.information[some])
            factor = self._shortfall_factor(count - pool.seen[some])
            cost[first : first + _AT_A_TIME] = (norms @ pool.share) * factor
        return cost

    def prepare(self) -> None:
        """Have ready what every network needs, before the search is handed to several processes."""
        _ = self.too_close, self.near, self._rough

    @cached_property
    def _rough(self) -> _Rough:
        return _Rough.of(self.candidates)

    def _broken_with_each(self, rest: Ints) -> Ints:
        among = self.too_close[rest]
        broken = among.sum(axis=0) + int(np.triu(among[:, rest], 1).sum())
        if self.near is not None and len(rest):
            near = self.near[rest]
            lonely = ~near[:, rest].any(axis=1)
            broken += (~near[lonely]).sum(axis=0)
            broken += ~near.any(axis=0)
        if self.candidates.matches is not None:
            broken = broken + self.candidates.matches.broken_with_each(rest)
        return np.asarray(broken)

    def _lack_with_each(self, rest: Ints) -> Floats:
        """The share (m,) by which the worst tier of coverage is missed with each candidate."""
        pool, rough = self.candidates, self._rough
        count = pool.seen[rest].sum(axis=0)
        lack = np.zeros(len(pool), dtype=rough.share.dtype)
        for tier in self.limits.coverage.tiers:
            enough = float((count >= tier.views) @ pool.share)
            wins = np.where(count == tier.views - 1, rough.share, rough.share.dtype.type(0.0))
            np.maximum(lack, tier.share - enough - rough.seen @ wins, out=lack)
        return lack

    def _shortfall_factor(self, count: Ints) -> Floats:
        """By how much (...) the cost is raised for views lacking among the counts (..., p)."""
        lack = np.zeros(count.shape[:-1])
        for tier in self.limits.coverage.tiers:
            lack = np.maximum(lack, tier.share - (count >= tier.views) @ self.candidates.share)
        return np.asarray(1.0 + _COVERAGE_WEIGHT * lack)

    def best_addition(self, rest: Ints) -> tuple[int, tuple[int, float]]:
        """The free candidate that helps a network most, and the score with it.

        Networks that are shaken come back to where they were, so what was found is kept.
        """
        rest = np.sort(rest)
        known = self._best_additions.get(rest.tobytes())
        if known is None:
            broken, cost = self.scores_with_each(rest)
            # What the rounding of both may hide is weighed exactly.
            close = np.flatnonzero(cost <= cost.min() * (1.0 + 2.0 * ROUGH))
            exact = [self._cost(np.append(rest, at)) for at in close]
            best = int(np.argmin(exact))
            known = int(close[best]), (int(broken[close[best]]), exact[best])
            self._best_additions[rest.tobytes()] = known
        return known

    @cached_property
    def _best_additions(self) -> dict[bytes, tuple[int, tuple[int, float]]]:
        return {}

    @property
    def fixed(self) -> Ints:
        """Indices of the cameras that are there already."""
        m = len(self.candidates)
        return np.arange(m - self.candidates.fixed, m)

    def grown(self, network: Ints, count: int) -> Ints:
        """A network grown to ``count`` free cameras, each time by the view that helps most."""
        while len(network) < count + self.candidates.fixed:
            network = np.append(network, self.best_addition(network)[0])
        return network

    def exchanged(self, network: Ints, passes: int = 12) -> Ints:
        """Each free camera in turn put where it helps most, until none moves."""
        network = network.copy()
        free_candidates = self.candidates.free
        best = self.score(network)
        for _ in range(passes):
            moved = False
            for k in np.flatnonzero(network < free_candidates):
                at, found = self.best_addition(np.delete(network, k))
                if found < (best[0], best[1] * (1.0 - 1e-9)):
                    network[k], best, moved = at, found, True
            if not moved:
                break
        return network
