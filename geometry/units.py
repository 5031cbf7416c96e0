"""The size of a scan: millimetres per unit of the file, given, declared or inferred."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from geometry.scan import ScanNote

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
"""Millimetres per unit by the unit's short name."""

UNIT_NAMES = {"mm": "millimetres", "cm": "centimetres", "m": "metres", "inch": "inches"}
"""The units in full."""

_HEAD_MM = (180.0, 420.0)
_BUST_MM = (300.0, 700.0)
_IMPOSSIBLE_MM = (25.0, 5000.0)
"""Beyond these the unit is wrong: millimetres and metres lie a factor of 1000 apart, inches 25."""

_STANDARD_HEAD_MM = 240.0
_ROWS = 50
_NECK_SHARE = 0.8


@dataclass(frozen=True)
class HeadPart:
    """Where the head ends below, and whether shoulders follow; heights in units of the file."""

    lower_end: float
    crown: float
    has_shoulders: bool


def find_head(samples: Floats) -> HeadPart:
    """The head among points (N, 3) that stand upright (Z up, X to the side).

    With shoulders, the head begins at the neck: the narrowest level between two wider ones.
    Without, the whole scan is the head.
    """
    z = samples[:, 2]
    low, high = float(z.min()), float(z.max())
    row = np.minimum(((z - low) / max(high - low, 1e-300) * _ROWS).astype(int), _ROWS - 1)
    width = np.array(
        [np.ptp(samples[row == k, 0]) if (row == k).any() else np.inf for k in range(_ROWS)]
    )
    filled = np.where(np.isfinite(width), width, 0.0)
    below = np.maximum.accumulate(filled)
    above = np.maximum.accumulate(filled[::-1])[::-1]
    waist = np.minimum(below, above) - width
    neck = int(waist.argmax())
    # Shoulders are wider than the head; a neck that merely flares at its cut is none.
    shoulders = width[neck] < _NECK_SHARE * above[neck] and below[neck] > 1.2 * above[neck]
    height = low + (neck + 0.5) / _ROWS * (high - low)
    return HeadPart(height if shoulders else low, high, bool(shoulders))


def mm_per_unit(samples: Floats, declared: str | None) -> tuple[float, ScanNote]:
    """Millimetres per unit of a head scan, and what that is based on.

    ``samples`` (N, 3) stand upright, in units of the file. The unit that the file declares comes
    first, then the usual ones, then the scale at which the head is 240 mm tall.
    """
    head = find_head(samples)
    low, high = _BUST_MM if head.has_shoulders else _HEAD_MM
    size = float(np.ptp(samples, axis=0).max())
    for unit in [declared] * (declared is not None) + list(MM_PER_UNIT):
        if unit is not None and low <= size * MM_PER_UNIT[unit] <= high:
            basis = "as the file says" if unit == declared else "from the size of the head"
            return MM_PER_UNIT[unit], ScanNote("inferred", f"units: {UNIT_NAMES[unit]}, {basis}")
    scale = _STANDARD_HEAD_MM / (head.crown - head.lower_end)
    text = (
        f"units unknown: scaled by {scale:.4g} so that the head is {_STANDARD_HEAD_MM:.0f} mm "
        "tall; give units or scale if you know better"
    )
    return scale, ScanNote("warning", text)


def size_warning(extents_mm: Floats) -> tuple[ScanNote, ...]:
    """A warning when a scan of extents (3,) has not the size of a head at the scale given.

    Raises :class:`InputError` where it is so far off that the unit must be wrong: it would take
    all memory to sample a head as large as a house at the distances that suit a face.
    """
    size = float(np.max(extents_mm))
    if not _IMPOSSIBLE_MM[0] <= size <= _IMPOSSIBLE_MM[1]:
        raise InputError(
            "scan-size",
            f"in the units given the head is {size:.4g} mm large",
            "give the units of the file, or leave them out to have them inferred",
        )
    if _HEAD_MM[0] <= size <= _BUST_MM[1]:
        return ()
    text = f"at the scale given the scan is {size:.4g} mm large, which no head is; check the units"
    return (ScanNote("warning", text),)
