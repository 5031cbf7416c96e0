"""``/v1/evaluations``: score the cameras of an existing rig with the figures of a design."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field

from service.api.context import ServiceDep
from service.api.job_routes import JobResource
from service.api.models import IdempotencyKeyHeader, Job, problems
from service.api.submission import Submission, submit
from service.kinds.base import Model
from service.kinds.evaluation import EVALUATION, EvaluationRequest, EvaluationResult

router = APIRouter(tags=["evaluations"])


class EvaluationBody(EvaluationRequest):
    """What to score, and on which scan."""

    scan_id: Annotated[str, Field(max_length=100)]


class EvaluationJob(Job[EvaluationResult]):
    """An evaluation: pending, running, or ended."""


class EvaluationPage(Model):
    """Evaluations, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[EvaluationJob]
    next: int | None


resource = JobResource(EVALUATION, "evaluations", EvaluationJob, EvaluationPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=EvaluationJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_evaluation(
    body: EvaluationBody,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> Job[EvaluationResult]:
    """Ask for an evaluation."""
    scan = service.store.scans.get(body.scan_id)
    request = body.placed_for_scan(scan.options)
    return submit(service, resource, Submission(request, scan), idempotency_key, response)


resource.add_to(router)
resource.add_shortcut(router, "evaluation", "evaluation.json", "application/json")
