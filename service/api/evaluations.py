"""``/v1/evaluations``: score the cameras of an existing rig with the figures of a design."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Response
from pydantic import Field

from rig.design.designfile import design_from_mapping
from rig.design.designmodel import DesignFile
from rig.specification.rigfile import RigFile, rig_from_mapping
from service.api.context import ServiceDep
from service.api.job_routes import JobResource
from service.api.models import IdempotencyKeyHeader, Job, Model, problems
from service.api.results import EvaluationResult
from service.api.submission import rig_for_scan, submit

router = APIRouter(tags=["evaluations"])


class EvaluationRequest(Model):
    """What to score: the cameras of ``design`` against the limits of ``rig``."""

    scan_id: Annotated[str, Field(max_length=100)]
    rig: Annotated[RigFile, Field(description="The structure of a rig file, as JSON.")]
    design: Annotated[
        DesignFile,
        Field(
            description="A design document; of an existing rig `schema` and `cameras` are enough."
        ),
    ]


class EvaluationJob(Job[EvaluationResult]):
    """An evaluation: pending, running, or ended."""


class EvaluationPage(Model):
    """Evaluations, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[EvaluationJob]
    next: int | None


resource = JobResource("evaluation", "evaluations", EvaluationJob, EvaluationPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=EvaluationJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_evaluation(
    request: EvaluationRequest,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> dict[str, Any]:
    """Ask for an evaluation."""
    scan = service.store.scans.get(request.scan_id)
    rig = rig_for_scan(request.rig, scan, {})
    # Only what places the cameras: the figures of the old design would be stored for nothing.
    design = request.design.model_dump(
        by_alias=True, exclude_unset=True, include={"schema_", "name", "cameras"}
    )
    design_from_mapping(design, "design", rig_from_mapping(rig).camera)
    content = {"rig": rig, "design": design}
    return submit(service, resource, content, idempotency_key, response, scan=scan)


resource.add_to(router)
resource.add_shortcut(router, "evaluation", "evaluation.json", "application/json")
