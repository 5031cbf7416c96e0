"""``/v1/captures``: what rigs photographed, asked for under ``/v1/rigs/{rig}/captures``."""

from __future__ import annotations

from functools import partial

from fastapi import APIRouter, Request, Response

from service.api.context import ServiceDep
from service.api.door import name_of
from service.api.job_routes import JobResource
from service.api.models import Job, problems
from service.kinds.base import Model
from service.kinds.rigs import CAPTURE, CaptureOutcome, CaptureRequest
from service.stations.jobs import take_capture
from service.stations.worker import StationWork

router = APIRouter(tags=["captures"])


class CaptureJob(Job[CaptureOutcome]):
    """A capture: running, or ended."""


class CapturePage(Model):
    """Captures, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[CaptureJob]
    next: int | None


resource = JobResource(CAPTURE, "captures", CaptureJob, CapturePage, with_files=False)


@router.post(
    "/v1/rigs/{rig}/captures",
    status_code=201,
    response_model=CaptureJob,
    responses=problems(400, 404, 409, 413, 422, 423, 503, 507)
    | {200: {"model": CaptureJob, "description": "This capture was asked for before."}},
)
def add_capture(
    request: CaptureRequest, http: Request, response: Response, service: ServiceDep, rig: str
) -> Job[CaptureOutcome]:
    """Take a capture, now. The answer comes at once; follow the job for what becomes of it.

    The same request again is answered with 200 and the capture there is. 409 while the rig is
    busy, which says for whom, 423 when its interlock is open, 503 when its box or cameras are
    not there.
    """
    work = StationWork(CAPTURE, partial(take_capture, request))
    asked_by = name_of(http.scope) or request.operator
    record, fresh = service.rigs.get(rig).begin(request, request.capture_id, work, asked_by)
    response.headers["Location"] = resource.location(record)
    if not fresh:
        response.status_code = 200
    return resource.document(record)


resource.add_to(router)
