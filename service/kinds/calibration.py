"""Calibrations: all cameras of a rig from pictures of targets."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from service.kinds.base import Figure, JobKind, Request, Result
from service.kinds.detection import Detection
from service.kinds.lens import LENS_TERMS, LensChoice, LensParameter

Triple = Annotated[list[float], Field(min_length=3, max_length=3)]


class KnownPoses(Request):
    """How well the design's poses are known, when they shall define the frame."""

    position_sigma_mm: Annotated[float, Field(gt=0.0, le=1e6)]
    rotation_sigma_deg: Annotated[float, Field(gt=0.0, le=360.0)]


class CalibrationRequest(Request):
    """How to calibrate. Everything may be left out."""

    name: Annotated[str, Field(max_length=100, description="What to call it.")] = ""
    poses_known_to: Annotated[
        KnownPoses | None, Field(description="The design's poses give the frame, this well.")
    ] = None
    model: Annotated[
        LensChoice | None,
        Field(description="Lens model of all cameras; the design's without it, and brown."),
    ] = None
    hold: Annotated[
        list[LensParameter], Field(max_length=12, description="Lens parameters not to adjust.")
    ] = Field(default_factory=list)
    free: Annotated[
        list[LensParameter], Field(max_length=12, description="Lens parameters without a prior.")
    ] = Field(default_factory=list)
    cross_validate: Annotated[
        bool, Field(description="Calibrate two halves as well, and compare.")
    ] = True

    @model_validator(mode="after")
    def _held_or_free(self) -> CalibrationRequest:
        both = sorted(set(self.hold) & set(self.free))
        if both:
            raise ValueError(f"{both[0]} is among hold and among free")
        terms = {"f", "cx", "cy", "b1", *LENS_TERMS[self.model or LensChoice.brown]}
        foreign = [name for name in self.free if name not in terms]
        if foreign and (self.model is not None or foreign[0] in ("k4", "k5", "k6")):
            raise ValueError(
                f"the {(self.model or LensChoice.brown).value} lens model has no {foreign[0].value}"
            )
        return self


class LateView(Result):
    """A picture that was taken at another moment than the others of its frame."""

    camera: str
    frame: str


class CameraCalibration(Result):
    """One calibrated camera with its sigmas, and how its pictures fit."""

    name: str
    points: int
    rejected: int
    rms_px: Figure
    coverage: Annotated[float, Field(description="Share of the image with targets in it.")]
    focal_length_px: float
    focal_sigma_px: Figure
    principal_point_px: list[float]
    principal_point_sigma_px: Figure
    distortion: Annotated[
        list[float],
        Field(description="k1, k2, p1, p2, k3; with k4, k5, k6, or of a fisheye k1 to k4."),
    ]
    position_mm: Triple
    position_sigma_mm: Figure
    rotation_rig_to_camera: list[Triple]
    rotation_sigma_deg: Figure


class CalibrationResult(Result):
    """What a calibration is worth."""

    detection: Detection
    converged: bool
    why_stopped: str
    iterations: int
    rms_px: Figure
    redundancy: int
    rejected: int
    late_views: list[LateView]
    cross_validation: Annotated[
        Figure,
        Field(description="Difference of two halves over its predicted sigma; 1 is as predicted."),
    ]
    scale: Annotated[str, Field(description="Where the size comes from.")]
    datum: str
    warnings: list[str]
    doubtful_lenses: Annotated[
        list[str],
        Field(description="Cameras whose focal length is too uncertain: do not use the result."),
    ] = Field(default_factory=list)
    unfit_lenses: Annotated[
        list[str],
        Field(description="Cameras whose lenses another model fits better: do not use the result."),
    ] = Field(default_factory=list)
    cameras: list[CameraCalibration]


CALIBRATION = JobKind("calibration", CalibrationRequest, CalibrationResult)
