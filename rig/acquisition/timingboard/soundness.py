"""Whether a picture of the timing board can be believed: one bad LED must not pass for a time.

Each bit is shown twice, by an LED and its opposite below it. While one is lit the other is not,
so the two together give the same light at every instant, as much as those of any other bit. What
covers, kills or lights one LED breaks that, unless it does what the LED does anyway.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from rig.acquisition.timingboard.graytime import Interval, lit_shares

_SURE = 6.0
"""Standard deviations; of 64 figures of a sound board none is so far off by chance."""
_STEADY = 0.45
_ENOUGH = 5
_UNEVEN = (0.12, 0.45)
"""By what share of its light a pair may differ from its neighbours: on a board of equal LEDs, and
on one whose LEDs are so unequal that their own spread says more."""
_AROUND = 0.15
"""By what share of an LED's light the strip round one may be brighter than round the others."""
_SPREAD_ROOM = 2.0
"""Some eight LEDs tell how unequal all are to a quarter: room for twice that."""
_NEGATIVE = 0.05
_MISFIT = 0.03
"""How far a bit's share may be from what the exposure would give; the reader's floor is 0.004."""
_CONTRADICTION = 3.5
"""Standard deviations of a bit's share, which know of unequal LEDs and are generous about them."""
_LENGTH_SHARE = 0.35
"""By what share an exposure may differ in length from the one that was asked for."""
_CAUSES = (
    "clear what covers or lights the LEDs, see that each can be lit and go out, and hold the "
    "board so that its rows run along a rolling shutter's"
)


@dataclass(frozen=True, eq=False)
class Lamps:
    """What was read of the LEDs, (2, bits) each: upper row, lower row.

    ``level`` of light above the board round it, its standard ``error``, and ``around``, the
    light of the board round it.
    """

    level: Floats
    error: Floats
    around: Floats


def require_sound(lamps: Lamps) -> Floats:
    """By how much a bad LED may have changed each pair's share unseen: its standard deviation.

    Where pairs differ by little, nothing tells a fault that hides there from LEDs unequally
    bright by themselves: what a pair is unlike the others counts as one LED's fault altogether.
    Raises :class:`InputError` ``board-uneven`` naming the pair that is not like the others.
    """
    full = lamps.level.sum(axis=0)
    bright = float(np.median(full))
    error = np.hypot(*lamps.error) / bright
    light = lamps.around - np.median(lamps.around)
    lit = np.abs(light) > _AROUND * bright
    below = lamps.level < -_NEGATIVE * bright - _SURE * lamps.error
    strange = (lit | below).any(axis=0)
    if strange.any():
        raise _uneven(int(np.flatnonzero(strange)[0]), "has light or shadow round it")
    relative = full / bright / _trend(full / bright) - 1.0
    # Bits that do not change show one LED each, whatever the shutter does.
    steady = np.abs(lamps.level[0] / full - 0.5) > _STEADY
    alone = relative[steady] if steady.sum() >= _ENOUGH else relative
    spread = 1.4826 * float(np.median(np.abs(alone - np.median(alone))))
    room = np.clip(4.0 * spread, *_UNEVEN) + _SURE * error
    worst = int(np.argmax(np.abs(relative) - room))
    if abs(relative[worst]) > room[worst]:
        raise _uneven(worst, f"gives {100.0 * (1.0 + relative[worst]):.0f} % of the others' light")
    share = lamps.level[0] / full
    # Two LEDs of a pair that are not equally bright bend its share where both are lit for a while.
    unequal = share * (1.0 - share) * np.sqrt(2.0) * _SPREAD_ROOM * spread
    return np.asarray(np.hypot(relative, unequal))


def _trend(values: Floats) -> Floats:
    """A straight line, as a board seen aslant shows; a few bad pairs do not bend it."""
    places = np.arange(len(values))
    first, second = np.triu_indices(len(values), 1)
    slope = float(np.median((values[second] - values[first]) / (second - first)))
    middle = float(np.median(values - slope * places))
    return np.asarray(np.maximum(middle + slope * places, 0.2))


def _uneven(pair: int, what: str) -> InputError:
    return InputError("board-uneven", f"pair {pair + 1} of the timing board's LEDs {what}", _CAUSES)


def require_consistent(
    found: Interval, shares: Floats, sigmas: Floats, nominal_length_ticks: float | None
) -> None:
    """Raise :class:`InputError` ``board-unclear`` where no exposure gives these shares."""
    middle, length = np.array(found.middle_ticks), np.array(found.length_ticks)
    misfit = np.abs(lit_shares(middle, length, len(shares)) - shares)
    over = misfit > np.maximum(_MISFIT, _CONTRADICTION * sigmas)
    if over.any():
        raise InputError(
            "board-unclear",
            f"the LEDs of the timing board contradict each other (pair {int(np.argmax(over)) + 1} "
            f"by {misfit[over].max():.2f})",
            f"check tick, bits and order of the LEDs; {_CAUSES}",
        )
    if nominal_length_ticks is None:
        return
    off = abs(found.length_ticks / nominal_length_ticks - 1.0)
    if off > _LENGTH_SHARE + _SURE * found.length_sigma_ticks / nominal_length_ticks:
        raise InputError(
            "board-unclear",
            f"the timing board shows an exposure {found.length_ticks / nominal_length_ticks:.2f} "
            "times as long as the camera's",
            f"check the board's tick and the camera's exposure time; {_CAUSES}",
        )
