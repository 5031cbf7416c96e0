"""Cameras that are plainly off: what happened to each, told by full fits.

A fit that does not know of a camera several pixels off bends the reference's own errors to it, and
linear tests about that fit mislead. So these cameras are set free from the beginning.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.state import State
from calibration.check.epoch import Epoch
from calibration.check.fit import Fit, fit
from calibration.check.hypotheses import ALPHA, Cause, Hypothesis, log_tail
from calibration.check.linear import Columns, Linear


@dataclass(frozen=True, eq=False)
class _Suspect:
    """A camera and all that may have happened to it."""

    pose: Hypothesis
    lens: Hypothesis
    sync: Hypothesis | None

    @property
    def causes(self) -> list[Hypothesis]:
        """All of them."""
        return [self.pose, self.lens] + ([self.sync] if self.sync else [])


def fit_with(epoch: Epoch, state: State, causes: list[Hypothesis]) -> Fit:
    """A fit with causes free from the beginning."""
    base = Columns.of(epoch).count
    freed = [np.zeros((base, 0)), *(h.directions(base) for h in causes)]
    return fit(epoch, state, Linear(epoch, state, np.concatenate(freed, axis=1)))


def is_lens(by_pose: float, by_lens: float, by_both: float) -> bool:
    """Whether the lens is to blame rather than the camera's place, by what each explains.

    Through a long lens a turn and a shift of the principal point look alike, so the lens is
    blamed only when a movement does not explain the images and a change of the lens does.
    """
    return log_tail(by_both - by_pose, 3) < np.log(ALPHA) and by_lens > by_pose


def convicted(
    epoch: Epoch,
    state: State,
    tests: tuple[Hypothesis, ...],
    suspects: tuple[int, ...],
    unchanged: Fit,
) -> list[Hypothesis]:
    """For each suspected camera whether it moved, its lens changed, or it exposed late.

    ``unchanged``: the fit with nothing free. Cameras that are fine once the others are free are
    left out.
    """
    own = {(h.cause, h.subject): h for h in tests}
    rows = [
        _Suspect(own[Cause.POSE, c], own[Cause.LENS, c], own.get((Cause.CAMERA_SYNC, c)))
        for c in suspects
    ]
    found = [
        _cause(epoch, state, one, [o for o in rows if o is not one], unchanged) for one in rows
    ]
    return [h for h in found if h is not None]


def _cause(
    epoch: Epoch, state: State, one: _Suspect, others: list[_Suspect], unchanged: Fit
) -> Hypothesis | None:
    free = [h for other in others for h in other.causes]

    def explained(*causes: Hypothesis) -> float:
        return -fit_with(epoch, state, [*causes, *free]).chi2

    nothing = explained() if others else -unchanged.chi2
    by_pose, by_lens = explained(one.pose), explained(one.lens)
    best, gain = one.pose, by_pose - nothing
    if is_lens(by_pose, by_lens, explained(one.pose, one.lens)):
        best, gain = one.lens, by_lens - nothing
    margin = _margin(best, gain)
    if one.sync is not None:
        late = _margin(one.sync, explained(one.sync) - nothing)
        if late > margin:
            best, margin = one.sync, late
    return best if margin > 0.0 else None


def _margin(hypothesis: Hypothesis, gain: float) -> float:
    """How far beyond its limit a cause is, in natural logarithms of chance."""
    return float(np.log(hypothesis.alpha)) - log_tail(gain, hypothesis.ways.shape[1])
