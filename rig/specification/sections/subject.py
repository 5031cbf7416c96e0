"""The ``[scan]`` and ``[subject]`` sections: how to read the scan and what to design for."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from common.files.strict import Matrix, StrictModel, Vector
from geometry.face import RegionBox, RegionSphere
from geometry.preparation import SubjectOptions
from geometry.scanoptions import ScanOptions
from rig.specification.sections.plausible import Plausible, Position, RadiusMm, box_of_size

Axis = Literal["auto", "+x", "-x", "+y", "-y", "+z", "-z"]
Unit = Literal["auto", "mm", "cm", "m", "inch"]


def _tuples(value: Any) -> Any:  # noqa: ANN401 - whatever a section holds
    """Lists as tuples, so that options of a scan stay frozen."""
    return tuple(_tuples(one) for one in value) if isinstance(value, list | tuple) else value


def _lists(value: Any) -> Any:  # noqa: ANN401 - whatever an option holds
    """Tuples as lists, as files have them."""
    return [_lists(one) for one in value] if isinstance(value, tuple) else value


class ScanSection(StrictModel):
    """How to read the scan. What is left at ``auto`` is inferred, and the report says so."""

    units: Unit = Field(default="auto", description="Unit of the file's coordinates.")
    scale: Annotated[float, Plausible(1e-6, 1e6, 1.0)] | None = Field(
        default=None, description="Millimetres per unit, instead of units."
    )
    up: Axis = Field(default="auto", description="Axis of the file that points up.")
    front: Axis = Field(default="auto", description="Axis of the file that the face looks along.")
    subject: Literal["head", "object"] = Field(
        default="head", description='`"head"` expects a head\'s size; `"object"` takes anything.'
    )

    rotation_file_to_rig: Matrix | None = Field(
        default=None,
        description="Three rows of the rotation from the file's axes to the rig's, instead of up "
        "and front, for a scan that stands askew.",
    )
    nose_tip: Vector | None = Field(
        default=None,
        description="The nose tip in the file's coordinates, where the face is not found.",
    )
    left_eye: Vector | None = Field(
        default=None, description="Outer corner of the subject's left eye, likewise."
    )
    right_eye: Vector | None = Field(
        default=None, description="Outer corner of the subject's right eye, likewise."
    )

    def to_options(self) -> ScanOptions:
        """The options of the scan reader."""
        given = {key: _tuples(value) for key, value in self.model_dump().items()}
        return ScanOptions(**given)

    @classmethod
    def from_options(cls, options: ScanOptions) -> Self:
        """The section that describes ``options``."""
        return cls.model_validate({key: _lists(getattr(options, key)) for key in cls.model_fields})


class BoxRegion(StrictModel):
    """A box along the axes of the rig frame."""

    low_mm: Position = Field(description="Corner with the smaller coordinates.")
    high_mm: Position = Field(description="Corner with the greater coordinates.")

    @model_validator(mode="after")
    def _of_size(self) -> Self:
        box_of_size(self.low_mm, self.high_mm)
        return self


class BallRegion(StrictModel):
    """A ball."""

    centre_mm: Position = Field(description="Centre.")
    radius_mm: RadiusMm = Field(description="Radius.")


class SubjectSection(StrictModel):
    """Which part of the scan the rig is for."""

    region: Literal["face", "all", "targets"] = Field(
        default="face",
        description='`"face"` finds the face, `"all"` takes the whole surface, `"targets"` '
        "takes the points of the file as they are.",
    )
    box: BoxRegion | None = Field(
        default=None, description="Take this box instead of the found region."
    )
    sphere: BallRegion | None = Field(default=None, description="Take this ball instead.")
    design_points: int = Field(
        default=SubjectOptions().design_count,
        ge=4,
        le=100_000,
        description="How many points steer the design.",
    )
    check_points: int = Field(
        default=SubjectOptions().check_count,
        ge=4,
        le=200_000,
        description="How many points the result is judged by.",
    )

    @model_validator(mode="after")
    def _one_override(self) -> Self:
        if self.box is not None and self.sphere is not None:
            raise ValueError("give a box or a sphere, not both")
        return self

    def to_options(self, seed: int) -> SubjectOptions:
        """The options of the region finder."""
        box, sphere = self.box, self.sphere
        return SubjectOptions(
            region=self.region,
            box=RegionBox(np.array(box.low_mm), np.array(box.high_mm)) if box else None,
            sphere=RegionSphere(np.array(sphere.centre_mm), sphere.radius_mm) if sphere else None,
            design_count=self.design_points,
            check_count=self.check_points,
            seed=seed,
        )

    @classmethod
    def from_options(cls, options: SubjectOptions) -> Self:
        """The section that describes ``options``."""
        given: dict[str, object] = {
            "region": options.region,
            "design_points": options.design_count,
            "check_points": options.check_count,
        }
        if options.box is not None:
            low, high = options.box.low_mm.tolist(), options.box.high_mm.tolist()
            given["box"] = {"low_mm": low, "high_mm": high}
        if options.sphere is not None:
            centre, radius = options.sphere.centre_mm.tolist(), options.sphere.radius_mm
            given["sphere"] = {"centre_mm": centre, "radius_mm": radius}
        return cls.model_validate(given)
