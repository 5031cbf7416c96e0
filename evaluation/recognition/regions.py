"""Overlapping regions of the face: what changes with an expression spoils only some of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from evaluation.recognition.rangeimage import FACE_GRID
from geometry.arrays import Floats, Ints

_STEP = 2
"""Every second place of the grid: the images are smooth to its step, and models half as wide."""


@dataclass(frozen=True)
class Region:
    """An ellipse of the face's own frame: its middle and half axes, mm."""

    name: str
    x_mm: float
    z_mm: float
    half_width_mm: float
    half_height_mm: float


_LARGE = (
    Region("whole face", 0.0, 6.0, 58.0, 70.0),
    Region("upper face", 0.0, 42.0, 58.0, 40.0),
    Region("middle of the face", 0.0, 12.0, 58.0, 32.0),
    Region("lower face", 0.0, -30.0, 52.0, 36.0),
    Region("nose", 0.0, 14.0, 20.0, 30.0),
    Region("nose and eyes", 0.0, 26.0, 48.0, 26.0),
    Region("forehead", 0.0, 60.0, 50.0, 20.0),
    Region("mouth", 0.0, -32.0, 32.0, 18.0),
    Region("chin", 0.0, -50.0, 36.0, 16.0),
)
_DISCS = tuple(
    Region(f"disc {x:+.0f} {z:+.0f}", x, z, 24.0, 22.0)
    for z in (-42.0, -16.0, 10.0, 34.0, 58.0)
    for x in (-30.0, 0.0, 30.0)
)
_SIDES = tuple(
    Region(f"side {x:+.0f} {z:+.0f}", x, z, 34.0, 36.0)
    for z in (-26.0, 10.0, 44.0)
    for x in (-24.0, 24.0)
)

REGIONS: tuple[Region, ...] = (*_LARGE, *_DISCS, *_SIDES)
"""Thirty: Spreeuwers found that more overlapping regions hardly help beyond that."""


@lru_cache(maxsize=1)
def region_places() -> tuple[Ints, ...]:
    """For each region the places of it among those of :func:`thinned`."""
    z, x = FACE_GRID.z_mm[::_STEP], FACE_GRID.x_mm[::_STEP]
    xx, zz = (g.ravel() for g in np.meshgrid(x, z))
    return tuple(
        np.flatnonzero(
            ((xx - r.x_mm) / r.half_width_mm) ** 2 + ((zz - r.z_mm) / r.half_height_mm) ** 2 <= 1.0
        )
        for r in REGIONS
    )


def thinned(depth_mm: Floats) -> Floats:
    """The values (p,) of a range image (h, w) that regions are made of."""
    return np.asarray(depth_mm[::_STEP, ::_STEP].ravel())
