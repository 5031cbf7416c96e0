"""The ``[camera]`` section: one kind of camera with its lens and body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from annotated_types import Len
from pydantic import ConfigDict, Field, ValidationInfo, field_validator, model_validator

from common.files.strict import CameraName, Pair, StrictModel
from geometry.camera import Body, Camera
from rig.specification.sections.parts import CATALOGUE, with_parts
from rig.specification.sections.plausible import (
    LENGTHS,
    SMALL,
    BodyPlace,
    BodySize,
    FocusMm,
    LensSizeMm,
    Plausible,
    meant,
)

MICROMETRES = 1000.0
_SHORTEST, _USUAL, _LONGEST = 0.05, 1.5, 60.0
"""Focal lengths in diagonals of the picture: 169 degrees across, an ordinary lens, 1 degree."""


def tidy(value: float) -> float:
    """``value`` to 12 digits: 0.00577 mm must echo as 5.77 um, not as 5.7700000000000005."""
    return float(f"{value:.12g}")


class BodySection(StrictModel):
    """The solid a camera occupies, in the camera frame (x right, y down, z forward)."""

    size_mm: BodySize = Field(description="Width, height and depth of the body.")
    centre_mm: BodyPlace | None = Field(
        default=None,
        description="Centre of the body seen from the projection centre. Without it the body "
        "stands behind the lens and the projection centre lies half-way along the lens.",
    )
    lens_diameter_mm: LensSizeMm = Field(default=0.0, description="Outer diameter of the lens.")
    lens_length_mm: LensSizeMm = Field(
        default=0.0, description="How far the lens reaches out of the body's front."
    )
    mount_thread_mm: BodyPlace | None = Field(
        default=None,
        description="Centre of the 1/4-20 thread's mouth. Without it: the middle of the "
        "body's underside.",
    )

    def to_body(self) -> Body:
        """The body as geometry sees it."""
        size = np.array(self.size_mm)
        centre = self.centre_mm or [0.0, 0.0, -(self.lens_length_mm + self.size_mm[2]) / 2.0]
        thread = np.full(3, np.nan) if self.mount_thread_mm is None else self.mount_thread_mm
        return Body(
            size, np.array(centre), self.lens_diameter_mm, self.lens_length_mm, np.array(thread)
        )

    @classmethod
    def from_body(cls, body: Body) -> Self:
        """The section that describes ``body``."""
        return cls(
            size_mm=body.size_mm.tolist(),
            centre_mm=body.centre_camera_mm.tolist(),
            lens_diameter_mm=body.lens_diameter_mm,
            lens_length_mm=body.lens_length_mm,
            mount_thread_mm=body.mount_thread_camera_mm.tolist(),
        )


def _need_not_all(schema: dict[str, Any]) -> None:
    """In the JSON schema, what a model or a lens can supply is not required.

    That one of them must be there is left to the reader: an ``anyOf`` over so large an object
    keeps programs that make test data from a schema busy for minutes.
    """
    schema["required"] = [key for key in schema["required"] if key not in CameraSection.stand_ins]


class CameraSection(StrictModel):
    """One kind of camera with its lens, used at every place of the rig.

    ``model`` and ``lens`` name parts of the catalogue; keys that are given go before theirs.
    """

    model_config = ConfigDict(json_schema_extra=_need_not_all)
    stand_ins: ClassVar[Mapping[str, str]] = {
        "image_size_px": "model",
        "pixel_pitch_um": "model",
        "focal_length_mm": "lens",
        "f_number": "lens",
        "circle_of_confusion_um": "model",
        "min_focus_mm": "lens",
        "body": "model",
    }
    """Keys that need not be given when this other key is."""

    model: str | None = Field(
        default=None,
        min_length=1,
        max_length=100,
        description="A camera of the catalogue, by id or name (`rigwright catalogue`).",
    )
    lens: str | None = Field(
        default=None,
        min_length=1,
        max_length=100,
        description="A lens of the catalogue that fits it.",
    )
    name: CameraName = Field(
        default="camera",
        description="What to call this kind of camera. With `model` and `lens`: both ids.",
    )
    image_size_px: Annotated[list[Annotated[int, Field(ge=2, le=100_000)]], Len(2, 2)] = Field(
        description="Width and height of the image."
    )
    pixel_pitch_um: Annotated[float, Plausible(0.3, 100.0, 4.0, "micrometres", SMALL)] = Field(
        description="Distance of neighbouring pixels."
    )
    focal_length_mm: float = Field(gt=0.0, description="Focal length (principal distance).")
    f_number: Annotated[float, Plausible(0.5, 128.0, 8.0)] = Field(
        description="Aperture: 16 for f/16."
    )
    circle_of_confusion_um: Annotated[float, Plausible(0.3, 1000.0, 12.0, "micrometres", SMALL)] = (
        Field(
            description="Largest blur disk on the sensor that still counts as sharp. With `model`: "
            "two pixels.",
        )
    )
    min_focus_mm: FocusMm = Field(description="Nearest focus setting, from the projection centre.")
    focus_mm: FocusMm | None = Field(
        default=None,
        description="Focus setting. Without it the design chooses one per camera.",
    )
    distortion: Annotated[list[float], Len(4, 8)] = Field(
        default_factory=lambda: [0.0] * 5,
        description="Brown-Conrady terms k1, k2, p1, p2, k3 (OpenCV's order), with k4, k5, k6 "
        "for a rational lens, or k1, k2, k3, k4 of a fisheye.",
    )
    principal_point_px: Pair | None = Field(
        default=None,
        description="Principal point, pixel centres at integers. Without it: the image centre.",
    )
    body: BodySection = Field(description="The solid the camera occupies.")

    @model_validator(mode="before")
    @classmethod
    def _from_catalogue(cls, data: object, info: ValidationInfo) -> object:
        if not isinstance(data, Mapping):
            return data
        return with_parts(data, (info.context or {}).get(CATALOGUE))

    @field_validator("focal_length_mm")
    @classmethod
    def _of_a_lens(cls, value: float, info: ValidationInfo) -> float:
        """A lens is as long as its image is wide, more or less; only both together tell a unit."""
        size, pitch_um = info.data.get("image_size_px"), info.data.get("pixel_pitch_um")
        if size is None or pitch_um is None:
            return value
        pitch_mm = pitch_um / MICROMETRES
        diagonal_mm = float(np.hypot(*size)) * pitch_mm
        shortest, longest = _SHORTEST * diagonal_mm, _LONGEST * diagonal_mm
        lens = Plausible(max(shortest, 0.01), longest, _USUAL * diagonal_mm, "mm")
        if lens.holds(value):
            return value
        problem = f"no lens of that length has a picture of {diagonal_mm:.3g} mm across"
        raise ValueError(problem + meant(value, lens, (*LENGTHS, ("pixels", pitch_mm))))

    def to_camera(self) -> Camera:
        """The camera as geometry sees it."""
        point = [np.nan, np.nan] if self.principal_point_px is None else self.principal_point_px
        return Camera(
            name=self.name,
            image_size_px=(self.image_size_px[0], self.image_size_px[1]),
            pixel_pitch_mm=self.pixel_pitch_um / MICROMETRES,
            focal_length_mm=self.focal_length_mm,
            f_number=self.f_number,
            circle_of_confusion_mm=self.circle_of_confusion_um / MICROMETRES,
            min_focus_distance_mm=self.min_focus_mm,
            body=self.body.to_body(),
            focus_distance_mm=self.focus_mm,
            principal_point_px=np.array(point),
            distortion=np.array(self.distortion),
        )

    @classmethod
    def from_camera(cls, camera: Camera) -> Self:
        """The section that describes ``camera``."""
        return cls(
            name=camera.name,
            image_size_px=list(camera.image_size_px),
            pixel_pitch_um=tidy(camera.pixel_pitch_mm * MICROMETRES),
            focal_length_mm=camera.focal_length_mm,
            f_number=camera.f_number,
            circle_of_confusion_um=tidy(camera.circle_of_confusion_mm * MICROMETRES),
            min_focus_mm=camera.min_focus_distance_mm,
            focus_mm=camera.focus_distance_mm,
            distortion=camera.distortion.tolist(),
            principal_point_px=camera.principal_point_px.tolist(),
            body=BodySection.from_body(camera.body),
        )
