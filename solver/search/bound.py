"""How good any network of candidates could be: a lower bound by a convex relaxation.

Each candidate gets a weight from 0 to 1, and the weights add up to the number of cameras. The
norm of a point's covariance is convex in them, so the linear model at any weights, at its least
over all weights that are allowed, is below the cost of every network.
"""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from common.errors import CancelledError
from common.progress import CancelToken, NeverCancelled
from geometry.arrays import Bools, Floats, Ints
from geometry.camera import Camera, RigCamera
from geometry.subject import Subject
from solver.limits import Limits
from solver.result import Bound
from solver.search.candidates import Candidates, Placed, candidates, placed

_TWICE = 2
_STEPS = 400
_CLOSE = 0.003
"""A bound this near to the relaxation's own cost is not worth more steps."""

_OFF_DIAGONAL = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
_ROW, _COLUMN = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]


def bound_of(
    subject: Subject,
    camera: Camera,
    limits: Limits,
    cameras: tuple[RigCamera, ...],
    cancel: CancelToken | None = None,
    around: Placed | None = None,
) -> Bound | None:
    """How far a network of ``cameras`` may be from the best of candidates around the subject.

    Candidates stand as in the search, 6 degrees apart (``around``, where that is known); the
    network's own cameras that are not fixed are candidates too, so that nothing is said of less
    than the design itself. None where nobody else may stand. Raises :class:`CancelledError` soon
    after ``cancel`` is set.
    """
    free = tuple(c for c in cameras if not c.fixed)
    given = (*(c for c in cameras if c.fixed), *free)
    with threadpool_limits(1):
        pool = candidates(subject, limits, around or placed(subject, camera, limits, cancel), given)
        if not pool.free:
            return None
        network = np.arange(pool.free, len(pool))
        stands = np.zeros(len(pool), dtype=np.bool_)
        stands[network[: len(given) - len(free)]] = True
        cost = float(_norms(_total(pool, network)) @ pool.share)
        lower = lower_bound(pool, stands, len(free), cancel)
    unseen = float(pool.share[pool.seen.sum(axis=0) < _TWICE].sum())
    return Bound(min(lower, cost), cost, pool.free, len(pool.share), unseen)


def lower_bound(
    pool: Candidates, stands: Bools, count: int, cancel: CancelToken | None = None
) -> float:
    """Cost (mm2) below which no ``count`` candidates are, beside those that stand (m,).

    Weights grow by how much each candidate would help: the multiplicative rule of optimal
    design (Silvey, Titterington and Torsney 1978). A bound holds whatever the weights are.
    """
    token = cancel or NeverCancelled()
    m, p = len(pool), len(pool.share)
    tensor = pool.information.reshape(m, 6 * p)
    base = tensor[stands].sum(axis=0).reshape(6, p)
    base[:3] += pool.prior
    free = np.ascontiguousarray(tensor[~stands])
    weight = np.full(len(free), count / len(free))
    best = 0.0
    for _ in range(_STEPS):
        if token.is_set():
            raise CancelledError
        cost, slope = _cost_and_slope(base + (weight @ free).reshape(6, p), pool.share)
        help_ = free @ slope.reshape(-1)
        most = np.partition(help_, len(help_) - count)[len(help_) - count :].sum()
        best = max(best, cost + float(weight @ help_) - float(most))
        if cost - best < _CLOSE * cost:
            break
        weight *= np.sqrt(np.maximum(help_, 0.0))
        weight *= count / weight.sum()
    return best


def _cost_and_slope(entries: Floats, share: Floats) -> tuple[float, Floats]:
    """Mean norm of the covariances, and by how much information (6, p) makes it less.

    The slope of |Q| is -Q Q Q / |Q| for Q = N^-1.
    """
    q = np.linalg.inv(_matrices(entries))
    norm = np.linalg.norm(q, axis=(1, 2))
    cubed = q @ q @ q * (share / norm)[:, None, None]
    slope = cubed[:, _ROW, _COLUMN].T * _OFF_DIAGONAL[:, None]
    return float(norm @ share), np.asarray(slope)


def _matrices(entries: Floats) -> Floats:
    """Symmetric matrices (p, 3, 3) of entries (6, p)."""
    return np.asarray(entries[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]].transpose(2, 0, 1))


def _norms(entries: Floats) -> Floats:
    return np.asarray(np.linalg.norm(np.linalg.inv(_matrices(entries)), axis=(1, 2)))


def _total(pool: Candidates, network: Ints) -> Floats:
    entries = pool.information[network].sum(axis=0)
    entries[:3] += pool.prior
    return np.asarray(entries)
