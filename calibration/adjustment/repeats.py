"""Captures in which nothing was moved: they say again what one of them says."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from calibration.observations import Observations
from common.errors import InputError
from geometry.arrays import Bools, Floats, Ints

ALIKE_SHARE = 0.005
"""Targets that moved by less than this share of the image's width stand where they stood.

A lens is told from how the picture of a plate changes. Between two places so near it changes by
less than a twentieth of what it does between places a tenth of a picture apart.
"""

LEAST_COMMON = 4
"""Fewer targets in both pictures say nothing of a plate's place."""

FEW_PLACES = 6
NAMED = 3


@dataclass(frozen=True)
class Places:
    """Frames grouped by where the targets that move were held.

    ``groups``: indices of frames, one tuple for each place, in order of first use.
    """

    groups: tuple[tuple[int, ...], ...]

    @property
    def frames(self) -> int:
        """How many frames there are."""
        return sum(map(len, self.groups))

    @property
    def alike(self) -> tuple[int, ...]:
        """The frames of the largest group where it has more than one, else nothing."""
        largest = max(self.groups, key=len, default=())
        return largest if len(largest) > 1 else ()

    @property
    def few(self) -> bool:
        """Whether so much is repeated that too little is left."""
        return bool(self.alike) and (
            len(self.groups) < FEW_PLACES or len(self.groups) <= self.frames // 2
        )


def places_shown(observations: Observations) -> Places:
    """Where targets on carriers that move were held: frames that cannot be told apart in one group.

    Frames in which no such target was seen are left out.
    """
    fixed = np.array([c.fixed for c in observations.targets.carriers])
    moving = ~fixed[observations.targets.carrier_of[observations.target]]
    groups: list[list[int]] = []
    tables = _tables(observations, moving)
    for frame in sorted(tables):
        for group in groups:
            if _same(tables[frame], tables[group[0]], observations):
                group.append(frame)
                break
        else:
            groups.append([frame])
    return Places(tuple(map(tuple, groups)))


def alike_words(places: Places, observations: Observations) -> str:
    """Which frames are alike, as the beginning of a sentence."""
    names = [observations.frames[k] for k in places.alike]
    told = ", ".join(names[:NAMED]) + (", ..." if len(names) > NAMED else "")
    count = len(places.groups)
    return (
        f"{places.frames} captures show the targets in {count} "
        f"{'place' if count == 1 else 'places'} only ({told} are alike)"
    )


@contextmanager
def repeats_are_told(observations: Observations) -> Iterator[None]:
    """Where a calibration is refused and captures are alike, the refusal says so."""
    try:
        yield
    except InputError as error:
        places = places_shown(observations)
        if not places.few:
            raise
        raise InputError(
            error.detail,
            f"{error.problem}; {alike_words(places, observations)}",
            f"hold the targets elsewhere for each capture; {error.remedy}",
        ) from error


_Table = tuple[Ints, Floats]
"""Keys (n,) that name camera and target, in order, and their pixels (n, 2)."""


def _tables(observations: Observations, rows: Bools) -> dict[int, _Table]:
    """For each frame what its pictures show of the rows."""
    key = observations.camera * len(observations.targets.ids) + observations.target
    out: dict[int, _Table] = {}
    for frame in np.unique(observations.frame[rows]):
        own = np.flatnonzero(rows & (observations.frame == frame))
        keys, first = np.unique(key[own], return_index=True)
        out[int(frame)] = keys, observations.pixel[own[first]]
    return out


def _same(one: _Table, other: _Table, observations: Observations) -> bool:
    """Whether most targets that both show stand where they stood, in every camera."""
    keys, here, there = np.intersect1d(one[0], other[0], assume_unique=True, return_indices=True)
    # Held elsewhere, a plate leaves some pictures and enters others.
    if len(keys) < max(LEAST_COMMON, 0.5 * max(len(one[0]), len(other[0]))):
        return False
    camera = keys // len(observations.targets.ids)
    moved = np.linalg.norm(one[1][here] - other[1][there], axis=1)
    share = moved / observations.image_size_px[camera, 0]
    return all(np.median(share[camera == k]) < ALIKE_SHARE for k in np.unique(camera))
