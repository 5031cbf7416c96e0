"""Networks built once and not searched on: grown by the best view, or filtered out of all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from common.progress import CancelToken, go_on
from geometry.arrays import Ints
from geometry.camera import RigCamera
from solver.request import Request
from solver.search.candidates import Placed, candidates
from solver.search.networks import Search

Build = Callable[[Search, int, CancelToken], Ints]


def built_network(
    request: Request, around: Placed, cancel: CancelToken, build: Build
) -> list[tuple[RigCamera, ...]]:
    """The one network of new cameras that ``build`` makes of the candidates ``around`` the subject.

    None where it would break a rule about pairs of cameras.
    """
    limits, names = request.limits, request.names
    with threadpool_limits(1):
        pool = candidates(request.subject, limits, around, request.fixed)
        if pool.free < len(names):
            return []
        search = Search(pool, limits)
        network = build(search, len(names), cancel)
        if search.score(network)[0] > 0:
            return []
    chosen = np.sort(network[network < pool.free])
    return [tuple(replace(pool.cameras[k], name=n) for k, n in zip(chosen, names, strict=True))]


def next_best_views(search: Search, count: int, cancel: CancelToken) -> Ints:
    """A network of ``count`` free cameras, each put where it helps those before it most."""
    network = search.fixed
    for _ in range(count):
        go_on(cancel)
        network = np.append(network, search.best_addition(network)[0])
    return network


def filtered(search: Search, count: int, cancel: CancelToken) -> Ints:
    """A network of ``count`` free cameras: all candidates, less the one that is missed least.

    After the minimal networks of Alsadik (Sensors 14, 5785, 2014). Cameras that stand too close
    to another go first, and of those the one whose view is missed least.
    """
    network = np.arange(len(search.candidates))
    while np.count_nonzero(network < search.candidates.free) > count:
        go_on(cancel)
        network = np.delete(network, _missed_least(search, network, cancel))
    return network


def _missed_least(search: Search, network: Ints, cancel: CancelToken) -> int:
    """Place in ``network`` of the free camera to be taken out next."""
    free = network < search.candidates.free
    crowded = search.too_close[np.ix_(network, network)]
    np.fill_diagonal(crowded, val=False)
    worth = free & crowded.any(axis=1)
    if worth.any():
        at = np.flatnonzero(worth)
        return int(at[np.argmin(search.costs_without(network, at))])
    at = np.flatnonzero(free)
    broken = np.zeros(len(at), dtype=np.int64)
    # Without these rules no camera that is taken out can break any.
    if search.near is not None or search.candidates.matches is not None:
        for k, place in enumerate(at):
            go_on(cancel)
            broken[k] = search.broken(np.delete(network, place))
    return int(at[np.lexsort((search.costs_without(network, at), broken))[0]])
