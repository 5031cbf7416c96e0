"""The ``[scan]`` and ``[subject]`` sections: how to read the scan and what to design for."""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from geometry.reading import ScanOptions
from pydantic import Field, model_validator

from geometry.face import RegionBox as Box
from geometry.face import RegionSphere as Sphere
from geometry.preparation import SubjectOptions
from rig.strict import StrictModel, Vector

Axis = Literal["auto", "+x", "-x", "+y", "-y", "+z", "-z"]


class ScanSection(StrictModel):
    """How to read the scan. What is left at "auto" is inferred, and the report says so."""

    units: Literal["auto", "mm", "cm", "m", "inch"] = Field(
        default="auto", description="Unit of the file."
    )
    scale: float | None = Field(
        default=None, gt=0.0, description="Millimetres per unit, instead of units."
    )
    up: Axis = Field(default="auto", description="Axis of the file that points up.")
    front: Axis = Field(
        default="auto", description="Axis of the file that the face looks along."
    )
    subject: Literal["head", "object"] = Field(
        default="head", description='`"head"` expects a head\'s size; `"object"` takes anything.'
    )

    def to_options(self) -> ScanOptions:
        """The options of the scan reader."""
        return ScanOptions(**self.model_dump())

    @classmethod
    def from_options(cls, options: ScanOptions) -> Self:
        """The section that describes ``options``."""
        return cls(**{key: getattr(options, key) for key in cls.model_fields})


class RegionBox(StrictModel):
    """A box along the axes of the rig frame."""

    low_mm: Vector = Field(description="Corner with the smaller coordinates.")
    high_mm: Vector = Field(description="Corner with the greater coordinates.")


class RegionSphere(StrictModel):
    """A ball."""

    centre_mm: Vector = Field(description="Centre.")
    radius_mm: float = Field(gt=0.0, description="Radius.")


class SubjectSection(StrictModel):
    """Which part of the scan the rig is for."""

    region: Literal["face", "all", "targets"] = Field(
        default="face",
        description='`"face"` finds the face, `"all"` takes the whole surface, `"targets"` '
        "takes the points of the file as they are.",
    )
    box: RegionBox | None = Field(
        default=None, description="Take this box instead of the found region."
    )
    sphere: RegionSphere | None = Field(default=None, description="Take this ball instead.")
    design_points: int | None = Field(
        default=None, ge=4, le=100_000, description="How many points steer the design."
    )
    check_points: int | None = Field(
        default=None, ge=4, le=200_000, description="How many points the result is judged by."
    )

    @model_validator(mode="after")
    def _one_override(self) -> Self:
        if self.box is not None and self.sphere is not None:
            raise ValueError("give a box or a sphere, not both")
        return self

    def to_options(self, seed: int) -> SubjectOptions:
        """The options of the region finder; what is not given keeps its default."""
        given: dict[str, object] = {"region": self.region, "seed": seed}
        if self.box is not None:
            given["box"] = Box(np.array(self.box.low_mm), np.array(self.box.high_mm))
        if self.sphere is not None:
            given["sphere"] = Sphere(np.array(self.sphere.centre_mm), self.sphere.radius_mm)
        if self.design_points is not None:
            given["design_count"] = self.design_points
        if self.check_points is not None:
            given["check_count"] = self.check_points
        return SubjectOptions(**given)  # type: ignore[arg-type]

    @classmethod
    def from_options(cls, options: SubjectOptions) -> Self:
        """The section that describes ``options``."""
        box, sphere = options.box, options.sphere
        return cls(
            region=options.region,  # type: ignore[arg-type]
            box=None
            if box is None
            else RegionBox(low_mm=box.low_mm.tolist(), high_mm=box.high_mm.tolist()),
            sphere=None
            if sphere is None
            else RegionSphere(centre_mm=sphere.centre_mm.tolist(), radius_mm=sphere.radius_mm),
            design_points=options.design_count,
            check_points=options.check_count,
        )
