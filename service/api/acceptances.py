"""``/v1/acceptances``: whether a calibrated rig measures lengths as it should."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field

from service.api.context import ServiceDep
from service.api.job_routes import JobResource
from service.api.measuring import Pictures, made_file, picture_source, target_input
from service.api.models import IdempotencyKeyHeader, Job, problems
from service.api.submission import Submission, asked, submit
from service.kinds.acceptance import ACCEPTANCE, AcceptanceRequest, AcceptanceResult
from service.kinds.base import Id, Model

router = APIRouter(tags=["acceptances"])


class AcceptanceBody(AcceptanceRequest):
    """What to test with: pictures of a calibrated bar along seven lines."""

    calibration_id: Id
    target_set_id: Annotated[Id, Field(description="The bar, with its calibrated coordinates.")]
    pictures: Pictures


class AcceptanceJob(Job[AcceptanceResult]):
    """An acceptance test: pending, running, or ended."""


class AcceptancePage(Model):
    """Acceptance tests, newest first. ``next`` is the cursor of the next page."""

    items: list[AcceptanceJob]
    next: int | None


resource = JobResource(ACCEPTANCE, "acceptances", AcceptanceJob, AcceptancePage)


@router.post(
    resource.path,
    status_code=201,
    response_model=AcceptanceJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_acceptance(
    body: AcceptanceBody,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> Job[AcceptanceResult]:
    """Ask for an acceptance test in the style of VDI/VDE 2634 part 1."""
    reference = body.calibration_id
    run, inputs = picture_source(service, body.pictures, reference)
    file = made_file(service, reference, "calibration", "calibration.json", "calibration")
    inputs = (*inputs, file, target_input(service, body.target_set_id))
    submission = Submission(asked(AcceptanceRequest, body), inputs=inputs, run=run)
    return submit(service, resource, submission, idempotency_key, response)


resource.add_to(router)
resource.add_shortcut(router, "certificate", "certificate.pdf", "application/pdf")
