"""``/v1/reconstructions``: the surface that the pictures of one capture show."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field, model_validator

from service.api.context import ServiceDep
from service.api.job_routes import JobResource
from service.api.measuring import Pictures, made_file, picture_source
from service.api.models import IdempotencyKeyHeader, Job, problems
from service.api.submission import Submission, asked, submit
from service.kinds.base import Id, Model
from service.kinds.reconstruction import (
    RECONSTRUCTION,
    ReconstructionRequest,
    ReconstructionResult,
)

router = APIRouter(tags=["reconstructions"])


class ReconstructionBody(ReconstructionRequest):
    """Which pictures to reconstruct from, and where the cameras stood."""

    pictures: Pictures
    calibration_id: Annotated[
        Id | None, Field(description="The calibration of the cameras that took them.")
    ] = None
    design_id: Annotated[
        Id | None, Field(description="The design, where the cameras stand as designed.")
    ] = None

    @model_validator(mode="after")
    def _cameras_known(self) -> ReconstructionBody:
        if self.calibration_id is None and self.design_id is None:
            raise ValueError("give calibration_id, or design_id for cameras as designed")
        return self


class ReconstructionJob(Job[ReconstructionResult]):
    """A reconstruction: pending, running, or ended."""


class ReconstructionPage(Model):
    """Reconstructions, newest first. ``next`` is the cursor of the next page."""

    items: list[ReconstructionJob]
    next: int | None


resource = JobResource(RECONSTRUCTION, "reconstructions", ReconstructionJob, ReconstructionPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=ReconstructionJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_reconstruction(
    body: ReconstructionBody,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> Job[ReconstructionResult]:
    """Ask for the surface that the pictures of one capture show."""
    run, inputs = picture_source(service, body.pictures, body.calibration_id or "")
    for job_id, kind in ((body.calibration_id, "calibration"), (body.design_id, "design")):
        if job_id is not None:
            inputs = (*inputs, made_file(service, job_id, kind, f"{kind}.json", kind))
    submission = Submission(asked(ReconstructionRequest, body), inputs=inputs, run=run)
    return submit(service, resource, submission, idempotency_key, response)


resource.add_to(router)
resource.add_shortcut(router, "cloud", "cloud.ply", "application/octet-stream")
resource.add_shortcut(router, "mesh", "mesh.glb", "model/gltf-binary")
resource.add_shortcut(router, "report", "report.html", "text/html")
