"""Lengths along measuring lines, and the limit they are held against."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from calibration.defaults import VOLUME_MM
from common.errors import InputError

LEAST_LINES = 7
LEAST_LENGTHS = 5


class Outcome(StrEnum):
    """What an acceptance test can end with."""

    PASSED = "passed"
    FAILED = "failed"
    INCOMPLETE = "incomplete"


@dataclass(frozen=True)
class LengthLimit:
    """Maximum permissible error of a length L: ``E = A + K L``, at most B.

    ``a_um`` and ``b_um`` in micrometres, ``k_um_per_m`` in micrometres per metre.
    """

    a_um: float
    k_um_per_m: float
    b_um: float

    def __post_init__(self) -> None:
        values = (self.a_um, self.k_um_per_m, self.b_um)
        if not np.isfinite(values).all() or min(values) < 0.0 or not self.b_um > 0.0:
            raise InputError(
                "acceptance-limit",
                "the limit of a length must have A and K of zero or more and a positive B",
                "give a_um, k_um_per_m and b_um, for example 20, 50 and 40",
            )
        if self.a_um == 0.0 and self.k_um_per_m == 0.0:
            raise InputError(
                "acceptance-limit",
                "a limit with A = 0 and K = 0 permits no error at all",
                "give a positive a_um",
            )

    def at(self, length_mm: float) -> float:
        """The limit for a length, micrometres."""
        return min(self.a_um + self.k_um_per_m * length_mm * 1e-3, self.b_um)


@dataclass(frozen=True)
class Volume:
    """The measured volume: width, height and depth, mm."""

    width_mm: float = VOLUME_MM[0]
    height_mm: float = VOLUME_MM[1]
    depth_mm: float = VOLUME_MM[2]

    def __post_init__(self) -> None:
        sides = (self.width_mm, self.height_mm, self.depth_mm)
        if not np.isfinite(sides).all() or min(sides) <= 0.0:
            raise InputError(
                "acceptance-volume",
                "the sides of the measured volume must be positive",
                "give three lengths in millimetres",
            )

    @property
    def diagonal_mm(self) -> float:
        """Its space diagonal."""
        return float(np.sqrt(self.width_mm**2 + self.height_mm**2 + self.depth_mm**2))

    @property
    def shortest_mm(self) -> float:
        """Its shortest side."""
        return min(self.width_mm, self.height_mm, self.depth_mm)


@dataclass(frozen=True)
class MeasuredLength:
    """One length.

    Errors are measured less calibrated; ``sigma_um`` is what image noise and calibration predict
    of the error, the artefact's own uncertainty included.
    """

    line: str
    first: str
    second: str
    calibrated_mm: float
    measured_mm: float
    error_um: float
    sigma_um: float
    limit_um: float

    @property
    def within(self) -> bool:
        """Whether the error is within the limit."""
        return abs(self.error_um) <= self.limit_um


@dataclass(frozen=True)
class Acceptance:
    """An acceptance test.

    ``largest_um`` error by amount, ``rms_um``; ``scale_ppm`` the best common scale of measured
    against calibrated lengths with its sigma, and ``rms_after_scale_um``. ``missing``: sentences
    on what a whole test would have had; then a test without failure is incomplete.
    """

    outcome: Outcome
    limit: LengthLimit
    volume: Volume
    lengths: tuple[MeasuredLength, ...]
    lines: int
    largest_um: float
    rms_um: float
    scale_ppm: float
    scale_sigma_ppm: float
    rms_after_scale_um: float
    missing: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """The outcome in one sentence."""
        worst = max(self.lengths, key=lambda m: abs(m.error_um) / m.limit_um)
        told = (
            f"the largest error of {len(self.lengths)} lengths is {self.largest_um:.1f} um; "
            f"nearest to its limit is {worst.first}-{worst.second} on {worst.line} with "
            f"{worst.error_um:+.1f} um of {worst.limit_um:.1f} um"
        )
        if self.outcome is Outcome.PASSED:
            return f"Passed: {told}."
        if self.outcome is Outcome.FAILED:
            count = sum(not m.within for m in self.lengths)
            return f"Failed: {count} of {len(self.lengths)} lengths are beyond their limit; {told}."
        return f"Incomplete: {told}, but {self.missing[0]}."
