"""``/v1/checks``: whether a rig is still as it was calibrated, and which camera is not."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from fastapi.responses import HTMLResponse
from pydantic import Field

from service.api.calibrations import resource as calibrations
from service.api.context import ServiceDep
from service.api.job_routes import JobResource
from service.api.measuring import Pictures, completed, made_file, picture_source, target_input
from service.api.models import IdempotencyKeyHeader, Job, problems
from service.api.submission import Submission, asked, submit
from service.kinds.base import Id, Model
from service.kinds.check import CHECK, CheckOutcome, CheckRequest
from service.store.jobrecords import JobInput
from service.tasks.drifting import drift_page

router = APIRouter(tags=["checks"])
MOST_IN_HISTORY = 500


class CheckBody(CheckRequest):
    """What to check with."""

    calibration_id: Id
    pictures: Pictures
    target_set_id: Annotated[
        Id | None, Field(description="The targets shown; without it those of the calibration.")
    ] = None


class CheckJob(Job[CheckOutcome]):
    """A check: pending, running, or ended."""


class CheckPage(Model):
    """Checks, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[CheckJob]
    next: int | None


resource = JobResource(CHECK, "checks", CheckJob, CheckPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=CheckJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_check(
    body: CheckBody,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> Job[CheckOutcome]:
    """Ask whether a rig is still as it was calibrated."""
    reference = body.calibration_id
    run, inputs = picture_source(service, body.pictures, reference)
    file = made_file(service, reference, "calibration", "calibration.json", "calibration")
    inputs = (*inputs, file, _targets(service, body))
    submission = Submission(asked(CheckRequest, body), inputs=inputs, run=run)
    return submit(service, resource, submission, idempotency_key, response)


def _targets(service: ServiceDep, body: CheckBody) -> JobInput:
    if body.target_set_id is not None:
        return target_input(service, body.target_set_id)
    # The calibration keeps its own targets, even where the target set has been removed.
    for given in service.store.jobs.given(body.calibration_id):
        if given.role == "targets":
            return given
    raise AssertionError("a calibration is always given targets")


@router.get(
    calibrations.path + "/{job_id}/history",
    response_class=HTMLResponse,
    responses=problems(404, 409, 422)
    | {200: {"description": "A page.", "content": {"text/html": {}}}},
)
def read_calibration_history(service: ServiceDep, job_id: str) -> HTMLResponse:
    """Read how a rig has drifted: a page with all checks against a calibration."""
    completed(service, job_id, calibrations.kind.name)
    checks = []
    for job in service.store.jobs.completed_against(resource.kind.name, job_id, MOST_IN_HISTORY):
        files = {file.name: file.path for file in service.store.jobs.files(job.id)}
        checks.append(files["check.json"])
    return HTMLResponse(drift_page(checks, job_id))


resource.add_to(router)
resource.add_shortcut(router, "check", "check.json", "application/json")
resource.add_shortcut(router, "report", "report.html", "text/html")
