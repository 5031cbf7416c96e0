"""``/v1/studies``: rigs compared over a grid of choices."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field

from common.errors import InputError
from service.api.context import Service, ServiceDep
from service.api.job_routes import JobResource
from service.api.models import IdempotencyKeyHeader, Job, problems
from service.api.submission import Submission, asked, submit
from service.kinds.base import Id, Model, RunContext
from service.kinds.design import RigExample
from service.kinds.study import STUDY, StudyRequest, StudyResult, head_role
from service.store.jobrecords import JobInput
from service.store.scans import ScanRecord
from service.tasks.examples import rig_of_file

router = APIRouter(tags=["studies"])


class StudyBody(StudyRequest):
    """Which rigs to compare over which choices, and for which scans."""

    scan_ids: Annotated[
        list[Id],
        Field(min_length=1, max_length=1000, description="Scans, all to be read in one way."),
    ]


class StudyJob(Job[StudyResult]):
    """A study: pending, running, or ended."""


class StudyPage(Model):
    """Studies, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[StudyJob]
    next: int | None


resource = JobResource(STUDY, "studies", StudyJob, StudyPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=StudyJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_study(
    body: StudyBody,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> Job[StudyResult]:
    """Ask for a study. Designs that an earlier one finished are not computed again."""
    scans = [service.store.scans.get(scan_id) for scan_id in body.scan_ids]
    request = asked(StudyRequest, body)
    request = request.for_scans([scan.filename for scan in scans], _one_way(scans))
    request.check()
    inputs = tuple(
        JobInput(head_role(number), scan.plain_name, scan.sha256)
        for number, scan in enumerate(scans, 1)
    )
    submission = Submission(request, inputs=inputs, run=_run(service))
    return submit(service, resource, submission, idempotency_key, response)


def _run(service: Service) -> RunContext:
    return RunContext(cache=str(service.settings.units_dir))


def _one_way(scans: list[ScanRecord]) -> dict[str, str | float]:
    """The options that all scans are read with. Raises :class:`InputError` where they differ."""
    if any(scan.options != scans[0].options for scan in scans):
        raise InputError(
            "study-scans",
            "the scans were uploaded with different units or axes, but a study reads all alike",
            "upload them again with the same, or save them alike",
        )
    return scans[0].options


@router.get(
    resource.path + "/{job_id}/recommended",
    response_model=RigExample,
    response_model_exclude_unset=True,
    responses=problems(404, 409),
)
def read_recommended_rig(service: ServiceDep, job_id: str) -> RigExample:
    """Read the recommended rig, to be sent with a design. 404 where none is recommended."""
    file = resource.file(service, job_id, "recommended.toml")
    return rig_of_file(Path(file.path), "recommended.toml")


resource.add_to(router)
resource.add_shortcut(router, "study", "study.json", "application/json")
resource.add_shortcut(router, "table", "study.csv", "text/csv")
resource.add_shortcut(router, "report", "report.html", "text/html")
