"""The ``[limits.zones]`` section: where cameras may and may not stand."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from common.files.strict import StrictModel, Vector
from rig.specification.sections.plausible import (
    FARTHEST_MM,
    Position,
    RadiusMm,
    box_of_size,
    length_mm,
)
from solver.limits import Box, HalfSpace, Sphere, Zone, ZoneOrigin, Zones

Use = Literal["allowed", "forbidden"]


class _ZoneSection(StrictModel):
    use: Use = Field(description='`"allowed"` or `"forbidden"`.')


class BoxSection(_ZoneSection):
    """A box along the axes of the rig frame."""

    low_mm: Position = Field(description="Corner with the smaller coordinates.")
    high_mm: Position = Field(description="Corner with the greater coordinates.")

    @model_validator(mode="after")
    def _of_size(self) -> Self:
        box_of_size(self.low_mm, self.high_mm)
        return self

    def to_zone(self) -> Zone:
        """The zone as the solver sees it."""
        return Box(np.array(self.low_mm), np.array(self.high_mm))


class SphereSection(_ZoneSection):
    """A ball."""

    centre_mm: Position = Field(description="Centre.")
    radius_mm: RadiusMm = Field(description="Radius.")

    def to_zone(self) -> Zone:
        """The zone as the solver sees it."""
        return Sphere(np.array(self.centre_mm), self.radius_mm)


class PlaneSection(_ZoneSection):
    """The side of a plane to which its normal points: ``normal . x >= offset_mm``."""

    normal: Vector = Field(description="Direction that points into the zone.")
    offset_mm: Annotated[float, length_mm(1.0, FARTHEST_MM, 300.0, zero=True, signed=True)] = Field(
        description="Distance of the plane from the zones' origin along the normal."
    )

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
    frame: ZoneOrigin | None = Field(
        default=None,
        strict=False,
        description='What coordinates start from, along the axes of the rig frame: `"head"`, '
        'the foremost point of the subject (the nose tip); `"rig"`, the origin of the rig frame. '
        "Without it: the origin where it lies in the scan or within 100 mm of it, otherwise the "
        "head.",
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
            about=self.frame,
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
        return cls(frame=zones.about, box=boxes, sphere=spheres, plane=planes)
