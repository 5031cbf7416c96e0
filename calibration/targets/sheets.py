"""Carriers laid out as sheets: markers or ring targets in rows, and scale bars."""

from __future__ import annotations

from collections.abc import Sequence

from calibration.observations import Distance
from calibration.targets.kinds import RING_QUIET, MarkerCarrier, RingCarrier, TargetPlace
from calibration.targets.ringcodes import RingCodeFamily
from common.errors import InputError

PRINT_SIGMA_MM = (0.05, 0.05, 0.1)
"""How well places on a good print on flat board are known: across, down, and off the plane."""


def marker_sheet(
    name: str,
    dictionary: str,
    numbers: Sequence[int],
    size_mm: float,
    columns: int = 4,
    gap_mm: float | None = None,
) -> MarkerCarrier:
    """Markers with dots in rows; ``gap_mm`` between them, by default half a marker."""
    step = size_mm + (size_mm / 2.0 if gap_mm is None else gap_mm)
    return MarkerCarrier(name, dictionary, size_mm, _rows(numbers, columns, step), dot=True)


def ring_sheet(
    name: str,
    numbers: Sequence[int],
    dot_radius_mm: float,
    bits: int = 12,
    columns: int = 4,
    gap_mm: float = 2.0,
) -> RingCarrier:
    """Ring targets in rows; ``gap_mm`` between their clear spaces."""
    step = 2.0 * RING_QUIET * dot_radius_mm + gap_mm
    spots = _rows(numbers, columns, step)
    return RingCarrier(name, dot_radius_mm, spots, RingCodeFamily(bits))


def scale_bar(
    name: str,
    numbers: Sequence[int],
    lengths_mm: Sequence[float],
    dot_radius_mm: float,
    bits: int = 12,
    sigma_mm: float = 0.05,
) -> tuple[RingCarrier, tuple[Distance, ...]]:
    """A bar with its first target at 0 and one at each length from it; and the distances.

    ``sigma_mm``: how well the lengths are known. A printed bar is as good as its print; give the
    measured lengths and their sigma once it has been measured.
    """
    if len(numbers) != len(lengths_mm) + 1 or sorted(set(lengths_mm)) != list(lengths_mm):
        raise InputError(
            "bar",
            f"scale bar {name!r} has {len(numbers)} targets for {len(lengths_mm)} rising lengths",
            "give rising lengths, and one target more than lengths",
        )
    sigma = (sigma_mm, 0.1, 0.1)
    spots = tuple(
        TargetPlace(n, (x, 0.0, 0.0), sigma)
        for n, x in zip(numbers, (0.0, *lengths_mm), strict=True)
    )
    bar = RingCarrier(name, dot_radius_mm, spots, RingCodeFamily(bits), bar=True)
    distances = tuple(
        Distance(bar.ids[0], bar.ids[k], float(x), sigma_mm) for k, x in enumerate(lengths_mm, 1)
    )
    return bar, distances


def _rows(numbers: Sequence[int], columns: int, step_mm: float) -> tuple[TargetPlace, ...]:
    if columns < 1:
        raise InputError("sheet", f"a sheet cannot have {columns} columns", "give 1 or more")
    return tuple(
        TargetPlace(n, (k % columns * step_mm, k // columns * step_mm, 0.0), PRINT_SIGMA_MM)
        for k, n in enumerate(numbers)
    )
