"""Causes that several cameras share: what remains of causes that partly cancel one another.

Pictures of three cameras of four that were cut alike look like those of all cut so, and of the
fourth cut the opposite way. Told is what happened to the fewest cameras by the fewest causes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import chdtri

from calibration.adjustment.camera import PER_CAMERA
from calibration.adjustment.state import State
from calibration.check.epoch import Epoch
from calibration.check.fit import Fit
from calibration.check.hypotheses import ALL_LENSES, ALPHA, Cause, Hypothesis
from calibration.check.suspects import fit_with
from geometry.arrays import Bools, Floats

LEAST_SHARING = 2
EXPLAINED = 4.0
"""Chi-square per image coordinate beyond which causes explain nothing that could be told better."""

OF_CAMERA = (Cause.POSE, Cause.LENS)
Causes = list[Hypothesis]


def fewest(
    epoch: Epoch, state: State, tests: Sequence[Hypothesis], accepted: Causes, last: Fit
) -> tuple[Causes, Fit]:
    """The accepted causes and their fit; or fewer that explain as much, one of them shared."""
    own = [h for h in accepted if h.cause in OF_CAMERA]
    if _stories(accepted) < 2 or not own or not _may_share(epoch, accepted):
        return accepted, last
    others = [h for h in accepted if h not in own and h.cause not in ALL_LENSES]
    whole = fit_with(epoch, state, accepted)
    if whole.chi2 > EXPLAINED * 2.0 * len(epoch.pixel):
        return accepted, last
    good: list[tuple[int, float, Causes, Fit]] = []
    for shared in _shared(epoch, state, tests, others, own):
        kept, found = _needed(epoch, state, own, [*others, *shared])
        limit = whole.chi2 + _limit(_freedom(accepted) - _freedom(kept))
        if found.chi2 < limit and _stories(kept) < _stories(accepted):
            good.append((_stories(kept), found.chi2 + _limit(1) * _freedom(kept), kept, found))
    if not good:
        return accepted, last
    *_, best, best_fit = min(good, key=lambda one: one[:2])
    return best, best_fit


def shared_by_some(
    epoch: Epoch, state: State, tests: Sequence[Hypothesis], enough: float
) -> tuple[Causes, float]:
    """Changes that some lenses share and that leave less than ``enough``, and what they leave."""
    lens, pose = (
        {h.subject: h for h in tests if h.cause is cause} for cause in (Cause.LENS, Cause.POSE)
    )
    for shared in _shared(epoch, state, tests, [], []):
        left = fit_with(epoch, state, shared).chi2
        if left >= enough:
            continue
        who = set((shared[0].columns // PER_CAMERA).tolist())
        moved, rest = [pose[k] for k in who], [lens[k] for k in set(lens) - who]
        gain = left - fit_with(epoch, state, moved).chi2
        # Some changed the one way, or one the other way: the fewer are told.
        alone = len(rest) == 1 and fit_with(epoch, state, rest).chi2 <= left
        if not alone and gain < _limit(_freedom(moved) - _freedom(shared)):
            return shared, left
    return [], np.inf


def _may_share(epoch: Epoch, accepted: Causes) -> bool:
    """Whether lenses are blamed at all, or so many cameras that it can be no chance."""
    blamed = {h.subject for h in accepted if h.cause in OF_CAMERA}
    most = 2 * len(blamed) > len(np.unique(epoch.camera))
    return most or any(h.cause in (Cause.LENS, *ALL_LENSES) for h in accepted)


def _stories(causes: Causes) -> int:
    """How many sentences causes need: one for all that is shared."""
    return sum(h.cause not in ALL_LENSES for h in causes) + any(
        h.cause in ALL_LENSES for h in causes
    )


def _freedom(causes: Causes) -> int:
    return sum(h.ways.shape[1] for h in causes)


def _limit(freedom: int) -> float:
    return float(chdtri(freedom, ALPHA)) if freedom > 0 else 0.0


def _needed(epoch: Epoch, state: State, own: Causes, fixed: Causes) -> tuple[Causes, Fit]:
    """The fixed causes with those of single cameras that explain something beside them."""
    kept = list(own)
    best = fit_with(epoch, state, [*kept, *fixed])
    none = fit_with(epoch, state, fixed)
    if none.chi2 - best.chi2 < _limit(_freedom(own)):
        return fixed, none
    for one in own:
        fewer = [h for h in kept if h is not one]
        without = fit_with(epoch, state, [*fewer, *fixed])
        if without.chi2 - best.chi2 < _limit(_freedom([one])):
            kept, best = fewer, without
    return [*kept, *fixed], best


def _shared(
    epoch: Epoch, state: State, tests: Sequence[Hypothesis], others: Causes, own: Causes
) -> Iterator[Causes]:
    """Shared changes that are worth a try, with the likeliest cameras for each."""
    lenses = [h for h in tests if h.cause is Cause.LENS]
    seen = [h.subject for h in lenses]
    alike = {h.cause: h for h in tests if h.cause in ALL_LENSES}
    tried: set[tuple[bytes, int]] = set()
    poses = [h for h in own if h.cause is Cause.POSE]
    for beside in ([], poses) if poses else ([],):
        fitted = fit_with(epoch, state, [*others, *beside, *lenses])
        change = fitted.unknowns[-3 * len(lenses) :].reshape(-1, 3).copy()
        # The focal length as what it does at the picture's border, to compare it with shifts.
        half = np.array([max(epoch.image_size_px[k]) for k in seen]) / 2.0
        change[:, 0] *= half / epoch.reference.interior[seen, 0]
        for number, (columns, causes) in enumerate(WAYS):
            who = _alike(change[:, columns])
            if who.sum() >= LEAST_SHARING and (who.tobytes(), number) not in tried:
                tried.add((who.tobytes(), number))
                yield [_of(alike[c], np.array(seen)[who]) for c in causes]


WAYS = (
    ([0], (Cause.ALL_FOCAL,)),
    ([1, 2], (Cause.ALL_SHIFT,)),
    ([0, 1, 2], ALL_LENSES),
)


def _alike(change: Floats) -> Bools:
    """The cameras (n,) whose changes (n, d) are nearer to one of them than to none, together."""
    size = np.sum(change**2, axis=1)
    away = np.sum((change[:, None] - change[None]) ** 2, axis=2)
    # Where one of them stands for all, what is left over all cameras is least.
    left = np.minimum(away, size[:, None]).sum(axis=0)
    first = int(np.argmin(left))
    return np.asarray(away[:, first] < size)


def _of(every: Hypothesis, cameras: Floats) -> Hypothesis:
    """The change of all lenses alike as one of some cameras (c,)."""
    own = np.isin(every.columns // PER_CAMERA, cameras)
    return Hypothesis(every.cause, 0, every.columns[own], every.ways[own], every.alpha)
