"""The exchange strategy: grow a network, exchange its views, shake it and exchange again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from common.progress import CancelToken
from geometry.arrays import Ints
from geometry.camera import Camera, RigCamera
from geometry.subject import Subject
from solver.limits import Limits
from solver.search.candidates import candidates
from solver.search.networks import Search

COARSE = 3
"""While networks are shaken they are weighed on every third point; the best of them on all."""

SHAKES = 10
_TAKEN_OUT = 3
_BEST_OF = 12


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
    with threadpool_limits(1):
        pool = candidates(subject, camera, limits, fixed, cancel)
        if len(pool) - pool.fixed < len(names):
            return []
        coarse = Search(pool.of_points(COARSE), limits)
        found = exchange(Search(pool, limits), coarse, len(names), seed, cancel)
    out = []
    for each in found:
        if each.score[0] == 0:
            chosen = sorted(k for k in each.network.tolist() if k < len(pool) - pool.fixed)
            out.append(
                tuple(replace(pool.cameras[k], name=n) for k, n in zip(chosen, names, strict=True))
            )
    return out


@dataclass(frozen=True, eq=False)
class Found:
    """A network of candidates and its score: rules broken, then cost in mm2."""

    network: Ints
    score: tuple[int, float]


def exchange(
    search: Search,
    coarse: Search,
    count: int,
    seed: int,
    cancel: CancelToken,
    shakes: int = SHAKES,
) -> list[Found]:
    """Networks of ``count`` free cameras, the best first, no two the same.

    Begins with the network grown by the view that helps most. A shake takes some cameras out,
    puts others in their places, each one of the best dozen by chance, and exchanges until
    nothing helps; what is better is kept and shaken on. The same seed gives the same networks.
    """
    rng = np.random.default_rng(seed)
    best = coarse.exchanged(search.grown(search.fixed, count))
    kept = {tuple(sorted(best.tolist())): best}
    score = coarse.score(best)
    for _ in range(shakes):
        if cancel.is_set():
            break
        trial = coarse.exchanged(_shaken(coarse, best, rng))
        found = coarse.score(trial)
        kept[tuple(sorted(trial.tolist()))] = trial
        if found < score:
            best, score = trial, found
    finest = sorted(kept.values(), key=coarse.score)[:4]
    out = {}
    for network in finest:
        fine = search.exchanged(network)
        out[tuple(sorted(fine.tolist()))] = Found(fine, search.score(fine))
    return sorted(out.values(), key=lambda f: f.score)


def _shaken(search: Search, network: Ints, rng: np.random.Generator) -> Ints:
    """A network with some of its free cameras put elsewhere."""
    free = np.flatnonzero(network < len(search.candidates) - search.candidates.fixed)
    out = rng.choice(free, min(_TAKEN_OUT, len(free)), replace=False)
    rest = np.delete(network, out)
    for _ in out:
        broken, cost = search.scores_with_each(rest)
        allowed = len(search.candidates) - search.candidates.fixed
        order = np.lexsort((cost[:allowed], broken[:allowed]))
        rest = np.append(rest, rng.choice(order[:_BEST_OF]))
    return np.asarray(rest)
