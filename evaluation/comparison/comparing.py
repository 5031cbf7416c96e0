"""The figures of a cloud against its reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from common.errors import InputError
from evaluation.comparison.alignment import Alignment, best_fit, unaligned
from evaluation.comparison.distances import Reference, signed_distances
from geometry.arrays import Bools, Floats

PERCENTILES = (50.0, 68.3, 95.0, 99.0, 99.9)
REACHES_MM = (0.1, 0.2, 0.3, 0.5, 1.0)
SAMPLE_MM = 0.5
"""Spacing of the places of the reference at which completeness is asked."""


@dataclass(frozen=True)
class Within:
    """What is compared: all that lies within ``radius_mm`` of ``centre_mm`` (3,)."""

    centre_mm: tuple[float, float, float]
    radius_mm: float

    def __post_init__(self) -> None:
        if not self.radius_mm > 0.0 or not np.isfinite(self.centre_mm).all():
            raise InputError("within", "the region to compare is empty", "give a radius above 0")

    def of(self, points_mm: Floats) -> np.ndarray:
        """Which points (N, 3) lie inside, (N,)."""
        offset = points_mm - np.asarray(self.centre_mm)
        return np.asarray(np.linalg.norm(offset, axis=1) <= self.radius_mm)


@dataclass(frozen=True)
class Figures:
    """Distances of the cloud to the reference, mm; shares of the reference near a point, percent.

    ``bias_mm`` is the mean of the signed distances, ``mad_mm`` the median absolute deviation
    about their median, ``percentiles_mm`` of the absolute distances, ``reached_percent`` the
    share of the reference's area within each of ``REACHES_MM`` of a point.
    """

    points: int
    left_out: int
    bias_mm: float
    rms_mm: float
    median_absolute_mm: float
    mad_mm: float
    percentiles_mm: tuple[tuple[float, float], ...]
    reached_percent: tuple[tuple[float, float], ...]
    points_per_mm2: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """The figures, the alignment they stand on, and the distance of each compared point.

    ``kept`` tells which points of the cloud (those in the region, where there is one) they are.
    """

    figures: Figures
    alignment: Alignment
    points_mm: Floats
    distances_mm: Floats
    kept: Bools


def compare(
    points_mm: Floats,
    reference: Reference,
    *,
    align: str = "none",
    within: Within | None = None,
    limit_mm: float = 5.0,
    places_mm: Floats | None = None,
) -> Comparison:
    """Compare a cloud (N, 3) with a reference in the same unit.

    ``align``: ``none``, ``best-fit`` or ``best-fit-scale``. Points farther than ``limit_mm`` are
    of something else than the reference: they are counted as ``left_out`` and nowhere else.
    ``places_mm`` (M, 3), spread evenly over the reference, are asked for completeness; without
    them the whole reference within the region.
    Raises :class:`InputError` where no point lies near the reference.
    """
    alignment = _aligned(points_mm, reference, align)
    moved = alignment.apply(points_mm)
    if within is not None:
        moved = moved[within.of(moved)]
    if len(moved) == 0:
        raise InputError("compare-empty", "no point of the cloud lies in the region", "widen it")
    distances, _ = signed_distances(moved, reference)
    near = np.abs(distances) <= limit_mm
    if not near.any():
        raise InputError(
            "compare-apart",
            f"no point of the cloud lies within {limit_mm:g} mm of the reference",
            "check that both are in millimetres and in one frame, or align them (--align best-fit)",
        )
    places = _places(reference, within) if places_mm is None else places_mm
    figures = _figures(moved[near], distances[near], int((~near).sum()), places)
    return Comparison(figures, alignment, moved[near], distances[near], near)


def _aligned(points_mm: Floats, reference: Reference, align: str) -> Alignment:
    if align == "none":
        return unaligned()
    if align in ("best-fit", "best-fit-scale"):
        return best_fit(points_mm, reference, with_scale=align.endswith("scale"))
    raise InputError("align", f"there is no alignment {align!r}", "give none or best-fit")


def _places(reference: Reference, within: Within | None) -> Floats:
    places = reference.samples(SAMPLE_MM)
    if within is not None:
        places = places[within.of(places)]
    if len(places) == 0:
        raise InputError("compare-empty", "the region holds nothing of the reference", "widen it")
    return places


def _figures(points: Floats, distances: Floats, left_out: int, places: Floats) -> Figures:
    absolute = np.abs(distances)
    # Bounded: places that nothing is near would search the whole tree.
    gaps, _ = cKDTree(points).query(places, distance_upper_bound=2.0 * REACHES_MM[-1])
    reached = tuple((r, float(100.0 * np.mean(gaps <= r))) for r in REACHES_MM)
    return Figures(
        points=len(points),
        left_out=left_out,
        bias_mm=float(distances.mean()),
        rms_mm=float(np.sqrt(np.mean(distances**2))),
        median_absolute_mm=float(np.median(absolute)),
        mad_mm=float(np.median(np.abs(distances - np.median(distances)))),
        percentiles_mm=tuple((p, float(np.percentile(absolute, p))) for p in PERCENTILES),
        reached_percent=reached,
        points_per_mm2=len(points) / (len(places) * SAMPLE_MM**2),
    )
