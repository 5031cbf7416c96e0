"""The ``[limits.zones]`` section: where cameras may and may not stand."""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import Field

from common.files.strict import StrictModel, Vector
from solver.limits import Box, HalfSpace, Sphere, Zone, Zones

Use = Literal["allowed", "forbidden"]


class _ZoneSection(StrictModel):
    use: Use = Field(description='`"allowed"` or `"forbidden"`.')


class BoxSection(_ZoneSection):
    """A box along the axes of the rig frame."""

    low_mm: Vector = Field(description="Corner with the smaller coordinates.")
    high_mm: Vector = Field(description="Corner with the greater coordinates.")

    def to_zone(self) -> Zone:
        """The zone as the solver sees it."""
        return Box(np.array(self.low_mm), np.array(self.high_mm))


class SphereSection(_ZoneSection):
    """A ball."""

    centre_mm: Vector = Field(description="Centre.")
    radius_mm: float = Field(gt=0.0, description="Radius.")

    def to_zone(self) -> Zone:
        """The zone as the solver sees it."""
        return Sphere(np.array(self.centre_mm), self.radius_mm)


class PlaneSection(_ZoneSection):
    """The side of a plane to which its normal points: ``normal . x >= offset_mm``."""

    normal: Vector = Field(description="Direction that points into the zone.")
    offset_mm: float = Field(description="Distance of the plane from the origin along the normal.")

    def to_zone(self) -> Zone:
        """The zone as the solver sees it."""
        length = float(np.linalg.norm(self.normal))
        # The offset is meant along the unit normal, whatever length was written.
        return HalfSpace(np.array(self.normal) / length if length else np.zeros(3), self.offset_mm)


class ZonesSection(StrictModel):
    """Inside one of the allowed zones, if there are any, and outside all forbidden ones."""

    enabled: bool = Field(
        default=True, description="`false` switches the limit off and keeps its numbers."
    )
    box: list[BoxSection] = Field(default_factory=list, description="Boxes.")
    sphere: list[SphereSection] = Field(default_factory=list, description="Balls.")
    plane: list[PlaneSection] = Field(default_factory=list, description="Sides of planes.")

    def to_zones(self) -> Zones:
        """The zones as the solver sees them."""
        if not self.enabled:
            return Zones()
        every: list[BoxSection | SphereSection | PlaneSection]
        every = [*self.box, *self.sphere, *self.plane]
        return Zones(
            allowed=tuple(z.to_zone() for z in every if z.use == "allowed"),
            forbidden=tuple(z.to_zone() for z in every if z.use == "forbidden"),
        )

    @classmethod
    def from_zones(cls, zones: Zones) -> Self:
        """The section that describes ``zones``."""
        boxes, spheres, planes = [], [], []
        uses: list[tuple[Use, tuple[Zone, ...]]] = [
            ("allowed", zones.allowed),
            ("forbidden", zones.forbidden),
        ]
        for use, zone in ((use, zone) for use, group in uses for zone in group):
            if isinstance(zone, Box):
                low, high = zone.low_mm.tolist(), zone.high_mm.tolist()
                boxes.append(BoxSection(use=use, low_mm=low, high_mm=high))
            elif isinstance(zone, Sphere):
                centre = zone.centre_mm.tolist()
                spheres.append(SphereSection(use=use, centre_mm=centre, radius_mm=zone.radius_mm))
            else:
                normal = zone.normal.tolist()
                planes.append(PlaneSection(use=use, normal=normal, offset_mm=zone.offset_mm))
        return cls(box=boxes, sphere=spheres, plane=planes)
