"""``/v1/plans``: what holds the cameras of a design, to be cut, drilled and aimed."""

from __future__ import annotations

from fastapi import APIRouter, Response

from service.api.context import ServiceDep
from service.api.designs import resource as designs
from service.api.job_routes import JobResource
from service.api.measuring import completed, made_file
from service.api.models import IdempotencyKeyHeader, Job, problems
from service.api.submission import Submission, asked, submit
from service.api.zipped import ZIP, streamed
from service.kinds.base import Id, Model
from service.kinds.plan import PLAN, PlanRequest, PlanResult

router = APIRouter(tags=["plans"])


class PlanBody(PlanRequest):
    """What to plan, and for which design."""

    design_id: Id


class PlanJob(Job[PlanResult]):
    """A plan: pending, running, or ended."""


class PlanPage(Model):
    """Plans, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[PlanJob]
    next: int | None


resource = JobResource(PLAN, "plans", PlanJob, PlanPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=PlanJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_plan(
    body: PlanBody,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> Job[PlanResult]:
    """Ask for a mount plan of a completed design. The design's scan must still be here."""
    design = completed(service, body.design_id, designs.kind.name)
    scan = service.store.scans.get(design.scan_id or "")
    request = asked(PlanRequest, body)
    request.check()
    file = made_file(service, body.design_id, designs.kind.name, "design.json", "design")
    return submit(service, resource, Submission(request, scan, (file,)), idempotency_key, response)


@router.get(
    resource.path + "/{job_id}/archive", response_class=Response, responses=problems(404, 409) | ZIP
)
def read_plan_archive(service: ServiceDep, job_id: str) -> Response:
    """Fetch all files of a plan in one ZIP archive."""
    completed(service, job_id, resource.kind.name)
    files = [(file.name, file.path) for file in service.store.jobs.files(job_id)]
    return streamed(files, "plan.zip", pictures=False)


resource.add_to(router)
resource.add_shortcut(router, "plan", "plan.json", "application/json")
resource.add_shortcut(router, "report", "plan.html", "text/html")
