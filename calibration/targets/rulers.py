"""The check ruler of a printed sheet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.errors import InputError


def require(condition: bool, detail: str, problem: str, remedy: str) -> None:
    """Raise a one-line :class:`InputError` unless the condition holds."""
    if not condition:
        raise InputError(detail, problem, remedy)


@dataclass(frozen=True)
class Ruler:
    """The check ruler of a printed sheet: its length as drawn and as measured on paper."""

    drawn_mm: float
    measured_mm: float
    sigma_mm: float = 0.1

    def __post_init__(self) -> None:
        good = np.isfinite([self.drawn_mm, self.measured_mm, self.sigma_mm]).all()
        require(
            bool(good) and min(self.drawn_mm, self.measured_mm, self.sigma_mm) > 0.0,
            "ruler",
            f"a ruler of {self.drawn_mm:g} mm measured as {self.measured_mm:g} mm cannot be",
            "give positive lengths in millimetres",
        )
        require(
            0.5 < self.scale < 2.0,
            "ruler-units",
            f"a ruler drawn {self.drawn_mm:g} mm long cannot have come out {self.measured_mm:g} mm",
            "measure in millimetres, or print again without scaling",
        )

    @property
    def scale(self) -> float:
        """What to multiply drawn lengths by."""
        return self.measured_mm / self.drawn_mm
