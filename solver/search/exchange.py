"""The exchange strategy: grow a network, exchange its views, shake it and exchange again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from common.progress import CancelToken
from geometry.arrays import Floats, Ints
from geometry.camera import RigCamera
from solver.request import Request
from solver.search.candidates import Candidates, Placed, candidates, directions_about, placed
from solver.search.networks import Search
from solver.workers import Report, Workers, silent

CHAINS = 4
"""Networks grown apart: a chain of shakes ends near where it begins, and which of them ends best
is chance."""

SHAKES = 160
"""Shakes of networks of the whole grid, all chains together."""

FINER = ((2.0, 32), (0.8, 16))
"""Steps in degrees of the rings of candidates about the cameras of the best networks so far, and
how many cameras that is at most, but two networks: one look after the other."""

FINER_SHAKES = 40
_FULL_EFFORT = 9
"""Cameras up to which networks are shaken so often: a shake takes as much longer as there are more,
so of more cameras there are fewer."""

_TAKEN_OUT = 3
_BEST_OF = 12
_KEPT = 8
_APART = 2
"""Networks kept beside each other differ in so many cameras: others end at the same optimum."""


def search_networks(
    request: Request, around: Placed, cancel: CancelToken, workers: Workers
) -> list[tuple[RigCamera, ...]]:
    """Networks of as many new cameras as are asked for, the best first; none where none may be.

    Only networks that break no rule about pairs of cameras. They are chosen ``around`` the subject
    first, then more finely. ``workers`` share the work, and do not change what comes of it. Raises
    :class:`CancelledError` soon after ``cancel`` is set.
    """
    subject, limits, names, fixed = request.subject, request.limits, request.names, request.fixed
    middle = request.target_mm
    with threadpool_limits(1):
        pool = candidates(subject, limits, around, fixed)
        if pool.free < len(names):
            return []
        search, shakes = Search(pool, limits), _shakes(SHAKES, names)
        found = exchange(search, len(names), request.seed, cancel, shakes, workers=workers)
        for step_deg, most in FINER if found[0].score[0] == 0 else ():
            some = found[: max(2, most // len(names))]
            outward = [pool.position_mm[_free(pool, f.network)] - middle for f in some]
            outward = [o / np.linalg.norm(o, axis=1, keepdims=True) for o in outward]
            near = directions_about(np.unique(np.concatenate(outward), axis=0), step_deg)
            close = placed(subject, request.camera, limits, cancel, outward=near, workers=workers)
            pool = candidates(subject, limits, close, fixed)
            search = Search(pool, limits)
            starts = [_nearest(search, o, middle) for o in outward]
            shakes = _shakes(FINER_SHAKES, names)
            found = exchange(search, len(names), request.seed, cancel, shakes, starts, workers)
    return [
        tuple(
            replace(pool.cameras[k], name=n)
            for k, n in zip(_free(pool, f.network), names, strict=True)
        )
        for f in found
        if f.score[0] == 0
    ]


def _shakes(most: int, names: tuple[str, ...]) -> int:
    return most * _FULL_EFFORT // max(_FULL_EFFORT, len(names))


def _free(pool: Candidates, network: Ints) -> Ints:
    """The candidates of a network that do not stand already, in their order."""
    return np.sort(network[network < pool.free])


def _nearest(search: Search, outward: Floats, middle: Floats) -> Ints:
    """The network of candidates nearest to the directions (n, 3), fixed cameras included."""
    pool = search.candidates
    away = (pool.position_mm[: pool.free] - middle) / pool.distance_mm[: pool.free, None]
    return np.concatenate([search.fixed, (outward @ away.T).argmax(axis=1)])


@dataclass(frozen=True, eq=False)
class Found:
    """A network of candidates and its score: rules broken, then cost in mm2."""

    network: Ints
    score: tuple[int, float]


def exchange(
    search: Search,
    count: int,
    seed: int,
    cancel: CancelToken,
    shakes: int,
    starts: Sequence[Ints] = (),
    workers: Workers | None = None,
) -> list[Found]:
    """Networks of ``count`` free cameras, the best first, no two alike in all but one camera.

    A chain begins with each of ``starts``; without any, one with the network grown by the view
    that helps most, others with every camera of it put elsewhere. A shake takes some cameras out,
    puts others in their places, each one of the best dozen by chance, and exchanges until nothing
    helps; what is better is kept and shaken on. ``shakes`` of all chains together. The same seed
    gives the same networks, however many ``workers`` share the chains. Raises
    :class:`CancelledError` soon after ``cancel`` is set.
    """
    workers = workers or Workers()
    begins: list[Ints | None] = list(starts) or [None] * CHAINS
    each = -(-shakes // len(begins))
    chains = [_Chain(k, search, count, seed, each, begin) for k, begin in enumerate(begins)]
    search.prepare()
    kept: dict[tuple[int, ...], Found] = {}
    for some in workers.run(chains, silent, cancel):
        kept |= {tuple(sorted(found.network.tolist())): found for found in some}
    return _apart(sorted(kept.values(), key=lambda f: f.score))


@dataclass(frozen=True, eq=False)
class _Chain:
    """One chain of shakes of networks of ``count`` free cameras.

    It begins with ``begin``, or with the network that is grown, which all chains but the first
    put elsewhere.
    """

    index: int
    search: Search
    count: int
    seed: int
    shakes: int
    begin: Ints | None

    def run(self, _report: Report, cancel: CancelToken) -> list[Found]:
        """All networks that it came by; see :class:`solver.workers.Job`."""
        search, rng = self.search, np.random.default_rng([self.seed, self.index])
        network = self.begin
        if network is None:
            network = search.grown(search.fixed, self.count)
            if self.index > 0:
                network = _shaken(search, network, rng, self.count)
        network = search.exchanged(network)
        best = Found(network, search.score(network))
        out = [best]
        for _ in range(self.shakes):
            if cancel.is_set():
                break
            trial = search.exchanged(_shaken(search, best.network, rng))
            found = Found(trial, search.score(trial))
            out.append(found)
            if found.score < best.score:
                best = found
        return out


def _apart(found: list[Found]) -> list[Found]:
    """The first few that differ from those before them."""
    out: list[Found] = []
    for each in found:
        if len(out) == _KEPT:
            break
        if all(len(np.setdiff1d(each.network, o.network)) >= _APART for o in out):
            out.append(each)
    return out


def _shaken(
    search: Search, network: Ints, rng: np.random.Generator, count: int = _TAKEN_OUT
) -> Ints:
    """A network with so many of its free cameras put elsewhere."""
    free = np.flatnonzero(network < search.candidates.free)
    out = rng.choice(free, min(count, len(free)), replace=False)
    rest = np.delete(network, out)
    for _ in out:
        broken, cost = search.scores_with_each(rest, _BEST_OF)
        allowed = search.candidates.free
        order = np.lexsort((cost[:allowed], broken[:allowed]))
        rest = np.append(rest, rng.choice(order[:_BEST_OF]))
    return np.asarray(rest)
