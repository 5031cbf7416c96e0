"""What a setting does to the pictures of all cameras alike: turned, mirrored, resized, cut.

Most of the cameras then do not fit the reference, and none of them can be blamed: such changes are
tried before single cameras, sizes of targets and swapped folders.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from calibration.adjustment.state import State
from calibration.check import messages
from calibration.check.consensus import Consensus, by_camera, consensus, misfit_px
from calibration.check.epoch import Epoch
from calibration.check.hypotheses import ALL_LENSES, ALPHA, Cause, Hypothesis, hypotheses
from calibration.check.shared import shared_by_some
from calibration.check.suspects import fit_with
from calibration.check.verdicts import Finding, Kind
from geometry.arrays import Floats

ALIKE = 1.5
"""Chi-square per image coordinate that one cause for all cameras may leave."""

OFF_PX = 8.0
GAIN = 0.1
"""Turned pictures that are turned back fit by so much better, and all of them."""

QUARTERS = (2, 1, 3)
FEW = 2


@dataclass(frozen=True, eq=False)
class Righted:
    """An epoch whose pictures were all turned alike, and are turned back; what there is to say."""

    epoch: Epoch
    start: Consensus
    findings: tuple[Finding, ...]


def turned_back(epoch: Epoch, start: Consensus) -> Righted:
    """Pictures of all cameras that are turned by quarters or mirrored, turned back.

    Of two cameras one spoils the other, and no others tell which: there each is tried alone, too.
    """
    now, seen = _off_px(epoch, start), np.unique(epoch.camera)
    if 2 * (now > OFF_PX).sum() < len(seen):
        return Righted(epoch, start, ())
    middle = (np.array(epoch.image_size_px, np.float64)[epoch.camera] - 1.0) / 2.0
    for who in (seen, *(seen[[k]] for k in range(len(seen)) if len(seen) == FEW)):
        own = np.isin(epoch.camera, who)[:, None]
        names = tuple(epoch.camera_names[int(k)] for k in who)
        for turn, sentence, value in _turns(names if len(who) < len(seen) else ()):
            pixel = np.where(own, (epoch.pixel - middle) @ turn + middle, epoch.pixel)
            back = replace(epoch, pixel=pixel)
            found = consensus(back)
            left = _off_px(back, found)
            if (left < OFF_PX).all() and left.sum() < GAIN * now.sum():
                told = Finding(Kind.LENS_CHANGED, names, sentence, value=value)
                return Righted(back, found, (told,))
    return Righted(epoch, start, ())


def _turns(one: tuple[str, ...]) -> list[tuple[Floats, str, float]]:
    """What turns pixels about the middle (n, 2) back, from the right, and what to say of it."""
    tries = [
        (
            _turn(q),
            messages.turned(one[0], 90 * q) if one else messages.all_turned(90 * q),
            90.0 * q,
        )
        for q in QUARTERS
    ]
    mirrored = messages.mirrored(one[0]) if one else messages.all_mirrored()
    return [*tries, (np.diag([-1.0, 1.0]), mirrored, -1.0)]


def _off_px(epoch: Epoch, found: Consensus) -> Floats:
    return by_camera(epoch, misfit_px(epoch, found.state))


def _turn(quarters: int) -> Floats:
    """What turns pixels about the middle (n, 2) back by quarters, from the right."""
    c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarters]
    return np.array([[c, -s], [s, c]])


def alike(
    epoch: Epoch, state: State, tests: Sequence[Hypothesis] | None = None
) -> tuple[Hypothesis, ...]:
    """The changes of all or some lenses alike that alone explain what cameras show; or none.

    Targets of another size look much alike: they must explain clearly less.
    """
    known = hypotheses(epoch) if tests is None else tests
    focal, shift = ([h for h in known if h.cause is cause] for cause in ALL_LENSES)
    enough = ALIKE * 2.0 * len(epoch.pixel)
    for causes in (focal, shift, [*focal, *shift]):
        left = fit_with(epoch, state, causes).chi2
        if left < enough:
            break
    else:
        causes, left = shared_by_some(epoch, state, known, enough)
        if not causes:
            return ()
    sizes = [h for h in known if h.cause is Cause.SCALE]
    by_size = fit_with(epoch, state, sizes).chi2
    return tuple(causes) if by_size - left > chdtri(len(sizes), ALPHA) else ()
