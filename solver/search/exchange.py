"""The exchange strategy: grow a network, exchange its views, shake it and exchange again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from common.progress import CancelToken
from geometry.arrays import Floats, Ints
from geometry.camera import Camera, RigCamera
from geometry.subject import Subject
from solver.limits import Limits
from solver.search.candidates import Candidates, candidates, directions_about
from solver.search.networks import Search

SHAKES = 80
"""Shakes of a network of the whole grid; more find hardly anything better on a head."""

FINER_DEG = (2.0, 0.8)
"""Steps of the rings of candidates about the best networks so far, one look after the other."""

FINER_SHAKES = 30
_TAKEN_OUT = 3
_BEST_OF = 12
_KEPT = 4
_APART = 2
"""Networks kept beside each other differ in so many cameras: others end at the same optimum."""


def search_networks(
    subject: Subject,
    camera: Camera,
    limits: Limits,
    names: tuple[str, ...],
    fixed: tuple[RigCamera, ...],
    seed: int,
    cancel: CancelToken,
) -> list[tuple[RigCamera, ...]]:
    """Networks of new cameras called ``names``, the best first; none where nobody may stand.

    Only networks that break no rule about pairs of cameras.
    """
    middle = subject.design_points.centroid_mm
    with threadpool_limits(1):
        pool = candidates(subject, camera, limits, fixed, cancel)
        if pool.free < len(names):
            return []
        found = exchange(Search(pool, limits), len(names), seed, cancel, SHAKES)
        for step_deg in FINER_DEG if found[0].score[0] == 0 else ():
            outward = [pool.position_mm[_free(pool, f.network)] - middle for f in found]
            outward = [o / np.linalg.norm(o, axis=1, keepdims=True) for o in outward]
            near = directions_about(np.unique(np.concatenate(outward), axis=0), step_deg)
            pool = candidates(subject, camera, limits, fixed, cancel, outward=near)
            search = Search(pool, limits)
            starts = [_nearest(search, o, middle) for o in outward]
            found = exchange(search, len(names), seed, cancel, FINER_SHAKES, starts)
    return [
        tuple(
            replace(pool.cameras[k], name=n)
            for k, n in zip(_free(pool, f.network), names, strict=True)
        )
        for f in found
        if f.score[0] == 0
    ]


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
) -> list[Found]:
    """Networks of ``count`` free cameras, the best first, no two alike in all but one camera.

    Begins with the best of ``starts`` and of the network grown by the view that helps most. A
    shake takes some cameras out, puts others in their places, each one of the best dozen by
    chance, and exchanges until nothing helps; what is better is kept and shaken on. The same
    seed gives the same networks.
    """
    rng = np.random.default_rng(seed)
    begun = [search.exchanged(n) for n in (search.grown(search.fixed, count), *starts)]
    kept = {tuple(sorted(n.tolist())): Found(n, search.score(n)) for n in begun}
    best, score = min(((f.network, f.score) for f in kept.values()), key=lambda pair: pair[1])
    for _ in range(shakes):
        if cancel.is_set():
            break
        trial = search.exchanged(_shaken(search, best, rng))
        found = search.score(trial)
        kept[tuple(sorted(trial.tolist()))] = Found(trial, found)
        if found < score:
            best, score = trial, found
    return _apart(sorted(kept.values(), key=lambda f: f.score))


def _apart(found: list[Found]) -> list[Found]:
    """The first few that differ from those before them."""
    out: list[Found] = []
    for each in found:
        if len(out) == _KEPT:
            break
        if all(len(np.setdiff1d(each.network, o.network)) >= _APART for o in out):
            out.append(each)
    return out


def _shaken(search: Search, network: Ints, rng: np.random.Generator) -> Ints:
    """A network with some of its free cameras put elsewhere."""
    free = np.flatnonzero(network < search.candidates.free)
    out = rng.choice(free, min(_TAKEN_OUT, len(free)), replace=False)
    rest = np.delete(network, out)
    for _ in out:
        broken, cost = search.scores_with_each(rest, _BEST_OF)
        allowed = search.candidates.free
        order = np.lexsort((cost[:allowed], broken[:allowed]))
        rest = np.append(rest, rng.choice(order[:_BEST_OF]))
    return np.asarray(rest)
