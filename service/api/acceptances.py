"""``/v1/acceptances``: whether a calibrated rig measures lengths as it should."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Response
from pydantic import Field

from calibration.acceptance import LengthLimit, Volume
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

router = APIRouter(tags=["acceptances"])
Micrometres = Annotated[float, Field(ge=0.0, le=1e6)]
Side = Annotated[float, Field(gt=0.0, le=1e5)]


class Limit(Model):
    """Largest error permitted of a length L: A + K L, at most B."""

    a_um: Micrometres = 20.0
    k_um_per_m: Micrometres = 50.0
    b_um: Annotated[float, Field(gt=0.0, le=1e6)] = 50.0


class MeasuredVolume(Model):
    """The volume that is measured in."""

    width_mm: Side = 300.0
    height_mm: Side = 300.0
    depth_mm: Side = 200.0


class AcceptanceRequest(Model):
    """What to test with: pictures of a calibrated bar along seven lines."""

    calibration_id: Id
    target_set_id: Annotated[Id, Field(description="The bar, with its calibrated coordinates.")]
    pictures: Pictures
    limit: Limit = Field(default_factory=Limit)
    volume: MeasuredVolume = Field(default_factory=MeasuredVolume)
    rig: Annotated[str, Field(max_length=100)] = ""
    operator: Annotated[str, Field(max_length=100)] = ""
    temperature_degc: Annotated[float | None, Field(ge=-50.0, le=100.0)] = None


class LengthEntry(Model):
    """One length against its limit."""

    line: str
    first: str
    second: str
    calibrated_mm: float
    measured_mm: float
    error_um: float
    sigma_um: float | None
    limit_um: float
    within: bool


class AcceptanceResult(Model):
    """The outcome of an acceptance test."""

    detection: Detection
    outcome: Literal["passed", "failed", "incomplete"]
    text: str
    lines: int
    largest_um: float
    rms_um: float
    scale_ppm: float | None
    scale_sigma_ppm: float | None
    missing: list[str]
    notes: list[str]
    lengths: list[LengthEntry]


class AcceptanceJob(Job[AcceptanceResult]):
    """An acceptance test: pending, running, or ended."""


class AcceptancePage(Model):
    """Acceptance tests, newest first. ``next`` is the cursor of the next page."""

    items: list[AcceptanceJob]
    next: int | None


resource = JobResource("acceptance", "acceptances", AcceptanceJob, AcceptancePage)


@router.post(
    resource.path,
    status_code=201,
    response_model=AcceptanceJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_acceptance(
    request: AcceptanceRequest,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> dict[str, Any]:
    """Ask for an acceptance test in the style of VDI/VDE 2634 part 1."""
    limit, volume = request.limit.model_dump(), request.volume.model_dump()
    LengthLimit(**limit), Volume(**volume)
    reference = request.calibration_id
    source, inputs = picture_source(service, request.pictures)
    file = made_file(service, reference, "calibration", "calibration.json", "calibration")
    content = source | {
        "reference": reference,
        "limit": list(limit.values()),
        "volume": list(volume.values()),
        "rig": request.rig,
        "operator": request.operator,
        "temperature_degc": request.temperature_degc,
    }
    inputs = (*inputs, file, target_input(service, request.target_set_id))
    return submit(
        service, resource, content, idempotency_key, response, inputs=inputs, unsaid=unsaid()
    )


resource.add_to(router)
resource.add_shortcut(router, "certificate", "certificate.pdf", "application/pdf")
