"""``/v1/designs``: a scan and a rig in, optimised camera poses and a mount layout out."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Response
from pydantic import Field

from rig.specification.rigfile import RigFile
from service.api.context import ServiceDep
from service.api.job_routes import JobResource
from service.api.models import LARGEST_JSON_INTEGER, IdempotencyKeyHeader, Job, Model, problems
from service.api.results import DesignResult
from service.api.submission import rig_for_scan, submit

router = APIRouter(tags=["designs"])


class DesignRequest(Model):
    """What to design. ``cameras`` and ``seed`` override those of the rig."""

    scan_id: Annotated[str, Field(max_length=100)]
    rig: Annotated[RigFile, Field(description="The structure of a rig file, as JSON.")]
    cameras: Annotated[
        int | None, Field(ge=1, le=500, description="How many cameras to place.")
    ] = None
    seed: Annotated[int | None, Field(ge=0, le=LARGEST_JSON_INTEGER)] = None


class DesignJob(Job[DesignResult]):
    """A design: pending, running, or ended."""


class DesignPage(Model):
    """Designs, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[DesignJob]
    next: int | None


resource = JobResource("design", "designs", DesignJob, DesignPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=DesignJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_design(
    request: DesignRequest,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> dict[str, Any]:
    """Ask for a design. Limits that cannot be are refused at once."""
    scan = service.store.scans.get(request.scan_id)
    given = {"cameras": request.cameras, "seed": request.seed}
    rig = rig_for_scan(request.rig, scan, {k: v for k, v in given.items() if v is not None})
    return submit(service, resource, {"rig": rig}, idempotency_key, response, scan=scan)


resource.add_to(router)
resource.add_shortcut(router, "design", "design.json", "application/json")
resource.add_shortcut(router, "layout", "layout.json", "application/json")
resource.add_shortcut(router, "report", "report.html", "text/html")
