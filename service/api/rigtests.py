"""``/v1/rig-tests``: self-tests, dry runs and synchronisation checks of rigs."""

from __future__ import annotations

import uuid
from functools import partial

from fastapi import APIRouter, Request, Response

from service.api.context import ServiceDep
from service.api.door import name_of
from service.api.job_routes import JobResource
from service.api.models import Job, problems
from service.kinds.base import Model
from service.kinds.rigs import RIG_TEST, RigTestOutcome, RigTestRequest
from service.stations.jobs import run_test
from service.stations.worker import StationWork

router = APIRouter(tags=["rig tests"])


class RigTestJob(Job[RigTestOutcome]):
    """A test of a rig: running, or ended."""


class RigTestPage(Model):
    """Tests, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[RigTestJob]
    next: int | None


resource = JobResource(RIG_TEST, "rig-tests", RigTestJob, RigTestPage, with_files=False)


@router.post(
    "/v1/rigs/{rig}/tests",
    status_code=201,
    response_model=RigTestJob,
    responses=problems(400, 404, 409, 413, 422, 423, 503, 507),
)
def add_rig_test(
    request: RigTestRequest, http: Request, response: Response, service: ServiceDep, rig: str
) -> Job[RigTestOutcome]:
    """Test a rig, now. 409 while it is busy, 503 when it is not open."""
    work = StationWork(RIG_TEST, partial(run_test, request))
    record, _ = service.rigs.get(rig).begin(request, str(uuid.uuid4()), work, name_of(http.scope))
    response.headers["Location"] = resource.location(record)
    return resource.document(record)


resource.add_to(router)
