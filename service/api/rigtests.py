"""``/v1/rig-tests``: self-tests, dry runs and synchronisation checks of rigs."""

from __future__ import annotations

import uuid
from typing import Any

from fastapi import APIRouter, Response

from service.api.context import ServiceDep
from service.api.job_routes import JobResource
from service.api.models import Job, Model, problems
from service.api.rigmodels import RigTestOutcome, RigTestRequest
from service.rigs.orders import TEST, test_order
from service.store.jobrecords import NewJob

router = APIRouter(tags=["rig tests"])


class RigTestJob(Job[RigTestOutcome]):
    """A test of a rig: running, or ended."""


class RigTestPage(Model):
    """Tests, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[RigTestJob]
    next: int | None


resource = JobResource(TEST, "rig-tests", RigTestJob, RigTestPage, with_files=False)


@router.post(
    "/v1/rigs/{rig}/tests",
    status_code=201,
    response_model=RigTestJob,
    responses=problems(400, 404, 409, 413, 422, 423, 503, 507),
)
def add_test(
    request: RigTestRequest, response: Response, service: ServiceDep, rig: str
) -> dict[str, Any]:
    """Test a rig, now. 409 while it is busy, 503 when it is not open."""
    content = request.model_dump()
    record, _ = service.rigs.get(rig).begin(
        NewJob(TEST, {"rig": rig, **content}), str(uuid.uuid4()), test_order(content)
    )
    document = resource.document(record)
    response.headers["Location"] = document["links"]["self"]
    return document


resource.add_to(router)
