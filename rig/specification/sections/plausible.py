"""What a number of a rig file can be, and in which unit it was given where it cannot be that.

Ranges are wide: they refuse what no camera, lens or room has, not what is unusual.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

from annotated_types import Len
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

Units = tuple[tuple[str, float], ...]
LENGTHS: Units = (
    ("metres", 1000.0),
    ("centimetres", 10.0),
    ("inches", 25.4),
    ("micrometres", 1e-3),
)
ANGLES: Units = (("radians", 180.0 / math.pi),)
SHARES: Units = (("per cent", 0.01),)
SMALL: Units = (("millimetres", 1000.0), ("nanometres", 1e-3), ("metres", 1e6))
"""By which each unit is multiplied to be millimetres, degrees, 0 to 1, and micrometres."""


@dataclass(frozen=True)
class Plausible:
    """A number from ``low`` to ``high``, to either side of zero where ``signed``.

    ``usual`` is what such a number mostly is: of the ``units`` by which it may have been given by
    mistake, the one that comes nearest to it is told. ``zero`` lets 0 pass as well.
    """

    low: float
    high: float
    usual: float
    unit: str = ""
    units: Units = ()
    zero: bool = False
    signed: bool = False

    def checked(self, value: float) -> float:
        """``value``; raises :class:`ValueError` that says what it should be."""
        size = abs(value) if self.signed else value
        if self.low <= size <= self.high or (self.zero and value == 0.0):
            return value
        raise ValueError(f"it should be {self._range()}{meant(value, self, self.units)}")

    def _range(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        either = ", to either side" if self.signed else ""
        zero = "0 or " if self.zero and self.low > 0.0 else ""
        return f"{zero}from {self.low:g} to {self.high:g}{unit}{either}"

    def holds(self, value: float) -> bool:
        """Whether ``value`` is within the range."""
        return self.low <= abs(value) <= self.high and (self.signed or value >= 0.0)

    def __get_pydantic_core_schema__(
        self, source: type, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.checked, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        low = -self.high if self.signed else 0.0 if self.zero else self.low
        return {**handler(schema), "minimum": low, "maximum": self.high}


def meant(value: float, range_: Plausible, units: Units) -> str:
    """``; did you mean 50 mm (0.05 metres)?`` where one of the units makes sense, else nothing."""
    found = {name: value * factor for name, factor in units}
    found = {name: v for name, v in found.items() if v != 0.0 and range_.holds(v)}
    if not found:
        return ""
    name = min(found, key=lambda n: abs(math.log(abs(found[n]) / range_.usual)))
    unit = f" {range_.unit}" if range_.unit else ""
    return f"; did you mean {found[name]:.4g}{unit} ({value:.6g} {name})?"


def length_mm(low: float, high: float, usual: float, **more: bool) -> Plausible:
    """A length in millimetres."""
    return Plausible(low, high, usual, "mm", LENGTHS, **more)


def angle_deg(low: float, high: float, usual: float, **more: bool) -> Plausible:
    """An angle in degrees."""
    return Plausible(low, high, usual, "degrees", ANGLES, **more)


FARTHEST_MM = 1e6
"""A kilometre, beyond which scans are refused too."""

PositionMm = Annotated[float, Plausible(0.0, FARTHEST_MM, 500.0, "mm", signed=True)]
Position = Annotated[list[PositionMm], Len(3, 3)]
BodyPlaceMm = Annotated[float, Plausible(0.0, 2000.0, 30.0, "mm", signed=True)]
BodyPlace = Annotated[list[BodyPlaceMm], Len(3, 3)]
BodySideMm = Annotated[float, length_mm(1.0, 2000.0, 60.0)]
BodySize = Annotated[list[BodySideMm], Len(3, 3)]
LensSizeMm = Annotated[float, length_mm(1.0, 2000.0, 40.0, zero=True)]
DistanceMm = Annotated[float, length_mm(30.0, FARTHEST_MM, 700.0, zero=True)]
"""From a camera to the subject."""

FocusMm = Annotated[float, length_mm(1.0, 1e7, 500.0)]
GapMm = Annotated[float, length_mm(0.0, 1e5, 10.0)]
RadiusMm = Annotated[float, length_mm(1.0, FARTHEST_MM, 300.0)]
MovementMm = Annotated[float, length_mm(0.1, 1000.0, 10.0, zero=True)]
TurnDeg = Annotated[float, angle_deg(0.2, 45.0, 5.0, zero=True)]
RangeMm = Annotated[float, length_mm(0.0, FARTHEST_MM, 500.0)]
RangeDeg = Annotated[float, angle_deg(0.0, 360.0, 20.0)]
Share = Annotated[float, Plausible(1e-6, 1.0, 0.95, "", SHARES)]
Ratio = Annotated[float, Plausible(0.0, 10.0, 0.3, "", SHARES)]
Pixels = Annotated[float, Plausible(0.0, 100_000.0, 20.0, "pixels")]

_LEAST_BOX_MM = 5.0
_LONGEST_M = 5.0


def box_of_size(low_mm: list[float], high_mm: list[float]) -> None:
    """Raises :class:`ValueError` for a box that no body and no face is as small as."""
    sides = [high - low for low, high in zip(low_mm, high_mm, strict=True)]
    if 0.0 < max(sides) < _LEAST_BOX_MM:
        text = " x ".join(f"{side:.3g}" for side in sides)
        raise ValueError(f"a box of {text} mm holds nothing; did you give its corners in metres?")


def place_of_size(position_mm: list[float]) -> list[float]:
    """Raises :class:`ValueError` for a place that lies within metres' digits of the origin."""
    size = max(abs(value) for value in position_mm)
    if 0.0 < size < _LONGEST_M and any(value % 1.0 for value in position_mm):
        places = ", ".join(f"{1000.0 * value:.6g}" for value in position_mm)
        raise ValueError(
            f"no camera stands {size:g} mm from the origin; did you mean [{places}] (metres)?"
        )
    return position_mm
