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
        pool = self.candidates
        entries = pool.information[network].sum(axis=0)
        entries[:3] += pool.prior
        cost = covariance_norms(entries) @ pool.share
        factor = self._shortfall_factor(pool.seen[network].sum(axis=0))
        return int(self._broken_with_each(network[:-1])[network[-1]]), float(cost * factor)

    def scores_with_each(self, rest: Ints, at_least: int = 1) -> tuple[Ints, Floats]:
        """Rules broken (m,) and cost (m,) of the network ``rest`` with each free candidate added.

        The cost is infinite where more rules are broken than by the ``at_least`` best.
        """
        pool = self.candidates
        base = pool.information[rest].sum(axis=0)
        base[:3] += pool.prior
        count = pool.seen[rest].sum(axis=0)
        broken = self._broken_with_each(rest)
        free = broken[: pool.free]
        most = np.sort(free)[min(at_least, len(free)) - 1]
        cost = np.full(len(pool), np.inf)
        worth = np.flatnonzero(free <= most)
        for first in range(0, len(worth), _AT_A_TIME):
            some = worth[first : first + _AT_A_TIME]
            norms = covariance_norms(base[None] + pool.information[some])
            cost[some] = (norms @ pool.share) * self._shortfall_factor(count + pool.seen[some])
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

    def _broken_with_each(self, rest: Ints) -> Ints:
        among = self.too_close[np.ix_(rest, rest)]
        inside = int(np.triu(among, 1).sum())
        broken = inside + self.too_close[:, rest].sum(axis=1)
        if self.near is not None and len(rest):
            lonely = rest[~self.near[np.ix_(rest, rest)].any(axis=1)]
            broken = broken + (~self.near[:, lonely]).sum(axis=1)
            broken = broken + ~self.near[:, rest].any(axis=1)
        if self.candidates.matches is not None:
            broken = broken + self.candidates.matches.broken_with_each(rest)
        return np.asarray(broken)

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
            at = _least(broken, cost, self.candidates.free)
            known = at, (int(broken[at]), float(cost[at]))
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


def _least(broken: Ints, cost: Floats, free: int) -> int:
    """Index of the least broken, then cheapest of the first ``free``."""
    order = np.lexsort((cost[:free], broken[:free]))
    return int(order[0])
