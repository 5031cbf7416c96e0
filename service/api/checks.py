"""``/v1/checks``: whether a rig is still as it was calibrated, and which camera is not."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Response
from fastapi.responses import HTMLResponse
from pydantic import Field

from calibration.check import Kind
from calibration.files import CHECKS
from calibration.report import history_of, history_page
from service.api.calibrations import resource as calibrations
from service.api.context import ServiceDep
from service.api.job_routes import JobResource
from service.api.measuring import (
    Detection,
    Id,
    Pictures,
    completed,
    made_file,
    picture_source,
    target_input,
    unsaid,
)
from service.api.models import IdempotencyKeyHeader, Job, Model, problems
from service.api.submission import submit
from service.store.jobrecords import JobInput

JSON = dict[str, Any]
router = APIRouter(tags=["checks"])
Light = Literal["green", "yellow", "red"]
MOST_IN_HISTORY = 500


class CheckRequest(Model):
    """What to check with."""

    calibration_id: Id
    pictures: Pictures
    target_set_id: Annotated[
        Id | None, Field(description="The targets shown; without it those of the calibration.")
    ] = None
    tolerance_mm: Annotated[
        float,
        Field(ge=0.0, le=1e3, description="Smaller effects at the subject turn no light red."),
    ] = 0.02
    hidden_limit_mm: Annotated[
        float,
        Field(gt=0.0, le=1e3, description="A camera that could hide more than this is not fine."),
    ] = 0.1


class FindingEntry(Model):
    """One thing that a check found. ``docs/explanation/calibration.md`` lists the kinds."""

    kind: Kind
    light: Light
    subjects: list[str]
    text: str
    effect_px: float | None
    effect_mm: Annotated[float | None, Field(description="At the subject.")]
    log10_p: Annotated[
        float | None, Field(description="Decimal logarithm of the chance of it by accident.")
    ]


class CameraVerdict(Model):
    """One camera: its verdict, its tests, and the smallest change they would have seen."""

    name: str
    verdict: Kind
    reason: str
    points: int
    rms_px: float | None
    pose_statistic: float | None
    pose_limit: float | None
    lens_statistic: float | None
    lens_limit: float | None
    effect_px: float | None
    effect_mm: float | None
    smallest_turn_urad: Annotated[
        list[float | None] | None,
        Field(description="Turns about its axes that 95 of 100 checks would report."),
    ]
    smallest_shift_um: Annotated[
        list[float | None] | None,
        Field(description="Shifts along its axes that 95 of 100 checks would report."),
    ]
    hidden_mm: Annotated[
        float | None, Field(description="Largest effect at the subject that could go unseen.")
    ]


class CheckOutcome(Model):
    """The verdict on a rig."""

    detection: Detection
    light: Light
    text: Annotated[str, Field(description="All findings as sentences.")]
    findings: list[FindingEntry]
    cameras: list[CameraVerdict]
    scale_ppm: float | None
    scale_sigma_ppm: float | None
    rms_px: float | None
    points: int
    outliers: int
    notes: list[str]


class CheckJob(Job[CheckOutcome]):
    """A check: pending, running, or ended."""


class CheckPage(Model):
    """Checks, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[CheckJob]
    next: int | None


resource = JobResource("check", "checks", CheckJob, CheckPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=CheckJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_check(
    request: CheckRequest,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> JSON:
    """Ask whether a rig is still as it was calibrated."""
    reference = request.calibration_id
    source, inputs = picture_source(service, request.pictures)
    file = made_file(service, reference, "calibration", "calibration.json", "calibration")
    content = source | {
        "reference": reference,
        "tolerance_mm": request.tolerance_mm,
        "hidden_limit_mm": request.hidden_limit_mm,
    }
    inputs = (*inputs, file, _targets(service, request))
    return submit(
        service, resource, content, idempotency_key, response, inputs=inputs, unsaid=unsaid()
    )


def _targets(service: ServiceDep, request: CheckRequest) -> JobInput:
    if request.target_set_id is not None:
        return target_input(service, request.target_set_id)
    # The calibration keeps its own targets, even where the target set has been removed.
    for given in service.store.jobs.given(request.calibration_id):
        if given.role == "targets":
            return given
    raise AssertionError("a calibration is always given targets")


@router.get(
    calibrations.path + "/{job_id}/history",
    response_class=HTMLResponse,
    responses=problems(404, 409, 422)
    | {200: {"description": "A page.", "content": {"text/html": {}}}},
)
def read_history(service: ServiceDep, job_id: str) -> HTMLResponse:
    """Read how a rig has drifted: a page with all checks against a calibration."""
    completed(service, job_id, calibrations.kind)
    records = []
    for job in service.store.jobs.page(resource.kind, MOST_IN_HISTORY, None):
        if job.request["reference"] != job_id or job.result is None:
            continue
        files = {file.name: file.path for file in service.store.jobs.files(job.id)}
        records.append(CHECKS.read(files["check.json"]))
    return HTMLResponse(history_page(history_of(records, job_id)))


resource.add_to(router)
resource.add_shortcut(router, "check", "check.json", "application/json")
resource.add_shortcut(router, "report", "report.html", "text/html")
