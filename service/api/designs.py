"""``/v1/designs``: a scan and a rig in, optimised camera poses and a mount layout out."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field

from service.api.context import ServiceDep
from service.api.job_routes import JobResource
from service.api.models import IdempotencyKeyHeader, Job, problems
from service.api.submission import Submission, asked, submit
from service.kinds.base import Model
from service.kinds.design import DESIGN, DesignRequest, DesignResult

router = APIRouter(tags=["designs"])


class DesignBody(DesignRequest):
    """What to design, and for which scan."""

    scan_id: Annotated[str, Field(max_length=100)]


class DesignJob(Job[DesignResult]):
    """A design: pending, running, or ended."""


class DesignPage(Model):
    """Designs, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[DesignJob]
    next: int | None


resource = JobResource(DESIGN, "designs", DesignJob, DesignPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=DesignJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_design(
    body: DesignBody,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> Job[DesignResult]:
    """Ask for a design. Limits that cannot be are refused at once."""
    scan = service.store.scans.get(body.scan_id)
    request = asked(DesignRequest, body).for_scan(scan.options)
    request.spec()
    return submit(service, resource, Submission(request, scan), idempotency_key, response)


resource.add_to(router)
resource.add_shortcut(router, "design", "design.json", "application/json")
resource.add_shortcut(router, "layout", "layout.json", "application/json")
resource.add_shortcut(router, "report", "report.html", "text/html")
