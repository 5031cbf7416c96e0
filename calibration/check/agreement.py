"""Which cameras agree with one another, when some are plainly off.

Most of them, when these agree to the noise. Otherwise any two cameras place the carriers; the two
under which the fewest others are off were not touched. That finds two cameras moved of four, where
no majority is left.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import INTERIOR, PER_CAMERA
from calibration.check.consensus import Consensus, by_camera, consensus, misfit_px
from calibration.check.epoch import Epoch
from calibration.check.fit import fit
from calibration.check.linear import Columns, Linear
from geometry.arrays import Bools, Floats

OFF_SIGMAS = 10.0
OFF_RATIO = 4.0
"""Half of a camera's points farther off than so many sigmas, and than so many times what the two
are themselves: something happened to it. What is smaller is told by linear tests."""

MOST_PAIRS = 60
MOST_CANDIDATES = 6
CAP_PX = 100.0


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A state, the cameras (n,) that are off in it, and how well the others fit."""

    found: Consensus
    strange: Bools
    cost: float


def agreeing(epoch: Epoch, start: Consensus) -> tuple[Consensus, tuple[int, ...]]:
    """Where the carriers stand for the cameras that agree, and the cameras that do not.

    No camera is named when all are off, or none, or when fewer than two would be left.
    """
    limit = OFF_SIGMAS * float(np.median(epoch.sigma_px))
    residual = by_camera(epoch, misfit_px(epoch, start.state)) > limit
    if not residual.any():
        return start, ()
    others = np.flatnonzero(~residual)
    again = consensus(epoch, among=others)
    left = by_camera(epoch, misfit_px(epoch, again.state)) > limit
    if 2 * len(others) > len(residual) and not left[others].any():
        return again, tuple(int(k) for k in np.flatnonzero(left))
    found = [c for c in (_of_pair(epoch, a, b, limit) for a, b in _pairs(epoch)) if c is not None]
    if not found:
        return start, ()
    fewest = min(int(c.strange.sum()) for c in found)
    best = [c for c in found if c.strange.sum() == fewest]
    chosen = _likeliest(epoch, sorted(best, key=lambda c: c.cost))
    others = np.flatnonzero(~chosen.strange)
    strange = tuple(int(k) for k in np.flatnonzero(chosen.strange))
    return consensus(epoch, among=others), strange


def _pairs(epoch: Epoch) -> list[tuple[int, int]]:
    seeing = [int(k) for k in np.unique(epoch.camera)]
    pairs = list(itertools.combinations(seeing, 2))
    return pairs[:: -(-len(pairs) // MOST_PAIRS)] if pairs else []


def _of_pair(epoch: Epoch, first: int, second: int, limit: float) -> _Candidate | None:
    """What two cameras say of the others; None when they do not agree themselves."""
    pair = np.array([first, second])
    found = consensus(epoch, among=pair)
    # Places that the two cannot see together say nothing.
    reported = np.isfinite(found.scale)[epoch.place]
    residual = by_camera(epoch, misfit_px(epoch, found.state), reported)
    own = float(residual[pair].max())
    strange = residual > max(limit, OFF_RATIO * own)
    if not reported.any() or own > limit or len(residual) - strange.sum() < 2:
        return None
    return _Candidate(found, strange, float(np.minimum(residual[~strange], CAP_PX).sum()))


def _likeliest(epoch: Epoch, candidates: list[_Candidate]) -> _Candidate:
    """The one whose cameras, set free, leave the least."""
    distinct: dict[bytes, _Candidate] = {}
    for c in candidates:
        distinct.setdefault(c.strange.tobytes(), c)
    few = list(distinct.values())[:MOST_CANDIDATES]
    if len(few) == 1:
        return few[0]
    return min(few, key=lambda c: _left(epoch, c))


def _left(epoch: Epoch, candidate: _Candidate) -> float:
    """Chi-square with the poses of the strange cameras free."""
    columns = Columns.of(epoch)
    state = consensus(epoch, among=np.flatnonzero(~candidate.strange)).state
    return fit(epoch, state, Linear(epoch, state, _poses(columns, candidate.strange))).chi2


def _poses(columns: Columns, cameras: Bools) -> Floats:
    """Directions (base, 6 c) of the poses of some cameras (n,)."""
    places = [columns.camera(int(k), INTERIOR, PER_CAMERA) for k in np.flatnonzero(cameras)]
    return (
        np.asarray(np.eye(columns.count)[:, np.concatenate(places)])
        if places
        else np.zeros((columns.count, 0))
    )
