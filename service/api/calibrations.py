"""``/v1/calibrations``: all cameras of a rig from pictures of targets."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Response
from pydantic import Field, model_validator

from service.api.context import ServiceDep
from service.api.job_routes import JobResource
from service.api.measuring import (
    Detection,
    Id,
    Pictures,
    made_file,
    picture_source,
    target_input,
    unsaid,
)
from service.api.models import IdempotencyKeyHeader, Job, Model, problems
from service.api.submission import submit

router = APIRouter(tags=["calibrations"])
Parameter = Literal["f", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "b1"]
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]


class KnownPoses(Model):
    """How well the design's poses are known, when they shall define the frame."""

    position_sigma_mm: Annotated[float, Field(gt=0.0, le=1e6)]
    rotation_sigma_deg: Annotated[float, Field(gt=0.0, le=360.0)]


class CalibrationRequest(Model):
    """What to calibrate with. Everything but targets and pictures may be left out."""

    target_set_id: Id
    pictures: Pictures
    name: Annotated[str, Field(max_length=100, description="What to call it.")] = ""
    design_id: Annotated[
        Id | None,
        Field(description="The design that was built, to start from; without it from nothing."),
    ] = None
    poses_known_to: Annotated[
        KnownPoses | None, Field(description="The design's poses give the frame, this well.")
    ] = None
    hold: Annotated[
        list[Parameter], Field(max_length=9, description="Lens parameters not to adjust.")
    ] = Field(default_factory=list)
    free: Annotated[
        list[Parameter], Field(max_length=9, description="Lens parameters without a prior.")
    ] = Field(default_factory=list)
    cross_validate: Annotated[
        bool, Field(description="Calibrate two halves as well, and compare.")
    ] = True

    @model_validator(mode="after")
    def _together(self) -> CalibrationRequest:
        both = sorted(set(self.hold) & set(self.free))
        if both:
            raise ValueError(f"{both[0]} is among hold and among free")
        if self.poses_known_to is not None and self.design_id is None:
            raise ValueError("poses_known_to is about the poses of a design: give design_id")
        return self


class LateView(Model):
    """A picture that was taken at another moment than the others of its frame."""

    camera: str
    frame: str


class CameraCalibration(Model):
    """One calibrated camera with its sigmas, and how its pictures fit."""

    name: str
    points: int
    rejected: int
    rms_px: float | None
    coverage: Annotated[float, Field(description="Share of the image with targets in it.")]
    focal_length_px: float
    focal_sigma_px: float | None
    principal_point_px: list[float]
    principal_point_sigma_px: float | None
    distortion: Annotated[list[float], Field(description="k1, k2, p1, p2, k3.")]
    position_mm: Triple
    position_sigma_mm: float | None
    rotation_rig_to_camera: list[Triple]
    rotation_sigma_deg: float | None


class CalibrationResult(Model):
    """What a calibration is worth."""

    detection: Detection
    converged: bool
    why_stopped: str
    iterations: int
    rms_px: float | None
    redundancy: int
    rejected: int
    late_views: list[LateView]
    cross_validation: Annotated[
        float | None,
        Field(description="Difference of two halves over its predicted sigma; 1 is as predicted."),
    ]
    scale: Annotated[str, Field(description="Where the size comes from.")]
    datum: str
    warnings: list[str]
    cameras: list[CameraCalibration]


class CalibrationJob(Job[CalibrationResult]):
    """A calibration: pending, running, or ended."""


class CalibrationPage(Model):
    """Calibrations, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[CalibrationJob]
    next: int | None


resource = JobResource("calibration", "calibrations", CalibrationJob, CalibrationPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=CalibrationJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_calibration(
    request: CalibrationRequest,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> dict[str, Any]:
    """Ask for a calibration of all cameras from pictures of a target set."""
    source, inputs = picture_source(service, request.pictures)
    inputs = (*inputs, target_input(service, request.target_set_id))
    if request.design_id is not None:
        inputs = (*inputs, made_file(service, request.design_id, "design", "design.json", "design"))
    known = request.poses_known_to
    content = source | {
        "name": request.name,
        "target_set_id": request.target_set_id,
        "hold": request.hold,
        "free": request.free,
        "poses_known_to": known and [known.position_sigma_mm, known.rotation_sigma_deg],
        "cross_validate": request.cross_validate,
    }
    return submit(
        service, resource, content, idempotency_key, response, inputs=inputs, unsaid=unsaid()
    )


resource.add_to(router)
resource.add_shortcut(router, "calibration", "calibration.json", "application/json")
resource.add_shortcut(router, "report", "report.html", "text/html")
