"""Where carriers stand in each frame, by the two cameras with which most others agree.

Pictures of another frame spoil the middle of few rays: of three cameras that see a plate one may
be late, of four two.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from calibration.check.consensus import Consensus, consensus, misfit_px
from calibration.check.epoch import Epoch
from geometry.arrays import Bools, Floats, Ints

FITS_PX = 8.0
MOST_PAIRS = 60
LEAST_VIEWS = 3
"""Where two cameras alone see a carrier and do not agree, nobody can tell which is right."""


def placed_by_pairs(epoch: Epoch, start: Consensus) -> Consensus:
    """The consensus, its moving carriers placed by pairs of cameras where that fits more views."""
    fits = _fits(epoch, start)
    views = np.bincount(epoch.view_place, minlength=len(epoch.place_carrier))
    doubtful = epoch.moving & (views >= LEAST_VIEWS)
    doubtful &= _count(epoch, fits) < views
    if not doubtful.any():
        return start
    best, count = start, _count(epoch, fits)
    for pair in _pairs(epoch, doubtful):
        found = consensus(epoch, among=np.array(pair))
        more = _count(epoch, _fits(epoch, found))
        # A place that one camera alone gives fits that camera whatever it shows.
        better = doubtful & np.isfinite(found.scale) & (more > count)
        best, count = _with_places(best, found, better, epoch), np.where(better, more, count)
    return best


def _pairs(epoch: Epoch, doubtful: Bools) -> list[tuple[int, int]]:
    """Pairs of cameras, those first that see most of the doubtful places together."""
    sees = np.zeros((len(epoch.camera_names), len(doubtful)), bool)
    sees[epoch.camera, epoch.place] = doubtful[epoch.place]
    both = sees.astype(np.int64) @ sees.T.astype(np.int64)
    pairs = [p for p in itertools.combinations(range(len(sees)), 2) if both[p]]
    # Of pairs that see as much those of the first cameras would be tried alone.
    order = np.random.default_rng(0).permutation(len(pairs))
    return sorted((pairs[k] for k in order), key=lambda pair: -both[pair])[:MOST_PAIRS]


def _fits(epoch: Epoch, found: Consensus) -> Bools:
    """Which views (v,) show a carrier where it is put."""
    misfit = misfit_px(epoch, found.state)
    middle = np.array(
        [
            np.median(misfit[own]) if (own := epoch.view == view).any() else np.inf
            for view in range(len(epoch.view_place))
        ]
    )
    return np.asarray(middle < FITS_PX)


def _count(epoch: Epoch, fits: Bools) -> Ints:
    """How many views of each place fit, (k,)."""
    return np.bincount(epoch.view_place[fits], minlength=len(epoch.place_carrier))


def _with_places(kept: Consensus, other: Consensus, which: Bools, epoch: Epoch) -> Consensus:
    def chosen(mine: Floats, theirs: Floats, mask: Bools) -> Floats:
        return np.where(mask.reshape(-1, *([1] * (mine.ndim - 1))), theirs, mine)

    views = which[epoch.view_place]
    state = replace(
        kept.state,
        position=chosen(kept.state.position, other.state.position, views),
        attitude=chosen(kept.state.attitude, other.state.attitude, views),
    )
    found_mm = chosen(kept.found_mm, other.found_mm, which)
    return Consensus(state, found_mm, chosen(kept.scale, other.scale, which))
