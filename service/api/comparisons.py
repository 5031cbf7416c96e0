"""``/v1/comparisons``: how far a cloud is from a reference surface."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field, model_validator

from service.api.context import Service, ServiceDep
from service.api.job_routes import JobResource
from service.api.measuring import made_file
from service.api.models import IdempotencyKeyHeader, Job, problems
from service.api.reconstructions import resource as reconstructions
from service.api.submission import Submission, asked, submit
from service.kinds.base import Id, Model
from service.kinds.comparison import COMPARISON, ComparisonRequest, ComparisonResult
from service.store.jobrecords import JobInput

router = APIRouter(tags=["comparisons"])


class ComparedCloud(Model):
    """The cloud: of a reconstruction, or uploaded as a scan (PLY) from another program."""

    reconstruction_id: Id | None = None
    scan_id: Id | None = None

    @model_validator(mode="after")
    def _one_source(self) -> ComparedCloud:
        if (self.reconstruction_id is None) == (self.scan_id is None):
            raise ValueError("give reconstruction_id or scan_id, one of them")
        return self


class ComparisonBody(ComparisonRequest):
    """What to compare with what, both in millimetres and as their files have them."""

    cloud: ComparedCloud
    reference_scan_id: Annotated[
        Id, Field(description="The reference surface: an uploaded scan, taken as its file is.")
    ]


class ComparisonJob(Job[ComparisonResult]):
    """A comparison: pending, running, or ended."""


class ComparisonPage(Model):
    """Comparisons, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[ComparisonJob]
    next: int | None


resource = JobResource(COMPARISON, "comparisons", ComparisonJob, ComparisonPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=ComparisonJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_comparison(
    body: ComparisonBody,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> Job[ComparisonResult]:
    """Ask how far a cloud is from a reference surface, and how much of it was reached."""
    inputs = (
        _cloud(service, body.cloud),
        _scan_file(service, body.reference_scan_id, "reference"),
    )
    submission = Submission(asked(ComparisonRequest, body), inputs=inputs)
    return submit(service, resource, submission, idempotency_key, response)


def _cloud(service: Service, cloud: ComparedCloud) -> JobInput:
    if cloud.reconstruction_id is not None:
        kind = reconstructions.kind.name
        return made_file(service, cloud.reconstruction_id, kind, "cloud.ply", "cloud")
    return _scan_file(service, str(cloud.scan_id), "cloud")


def _scan_file(service: Service, scan_id: str, role: str) -> JobInput:
    scan = service.store.scans.get(scan_id)
    return JobInput(role, scan.plain_name, scan.sha256)


resource.add_to(router)
resource.add_shortcut(router, "distances", "distances.ply", "application/octet-stream")
resource.add_shortcut(router, "report", "report.html", "text/html")
