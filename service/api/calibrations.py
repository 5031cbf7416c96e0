"""``/v1/calibrations``: all cameras of a rig from pictures of targets."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field, model_validator

from service.api.context import ServiceDep
from service.api.job_routes import JobResource
from service.api.measuring import Pictures, made_file, picture_source, target_input
from service.api.models import IdempotencyKeyHeader, Job, problems
from service.api.submission import Submission, asked, submit
from service.kinds.base import Id, Model
from service.kinds.calibration import CALIBRATION, CalibrationRequest, CalibrationResult

router = APIRouter(tags=["calibrations"])


class CalibrationBody(CalibrationRequest):
    """What to calibrate with. Everything but targets and pictures may be left out."""

    target_set_id: Id
    pictures: Pictures
    design_id: Annotated[
        Id | None,
        Field(description="The design that was built, to start from; without it from nothing."),
    ] = None

    @model_validator(mode="after")
    def _poses_of_a_design(self) -> CalibrationBody:
        if self.poses_known_to is not None and self.design_id is None:
            raise ValueError("poses_known_to is about the poses of a design: give design_id")
        return self


class CalibrationJob(Job[CalibrationResult]):
    """A calibration: pending, running, or ended."""


class CalibrationPage(Model):
    """Calibrations, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[CalibrationJob]
    next: int | None


resource = JobResource(CALIBRATION, "calibrations", CalibrationJob, CalibrationPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=CalibrationJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_calibration(
    body: CalibrationBody,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> Job[CalibrationResult]:
    """Ask for a calibration of all cameras from pictures of a target set."""
    run, inputs = picture_source(service, body.pictures)
    inputs = (*inputs, target_input(service, body.target_set_id))
    if body.design_id is not None:
        inputs = (*inputs, made_file(service, body.design_id, "design", "design.json", "design"))
    submission = Submission(asked(CalibrationRequest, body), inputs=inputs, run=run)
    return submit(service, resource, submission, idempotency_key, response)


resource.add_to(router)
resource.add_shortcut(router, "calibration", "calibration.json", "application/json")
resource.add_shortcut(router, "report", "report.html", "text/html")
