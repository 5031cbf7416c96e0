"""A real server that also counts: the whole application plus ``/v1/counts``."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import counting_job
from counting_job import COUNT, Counted, CountRequest
from fastapi import APIRouter, FastAPI, Response
from fastapi.responses import StreamingResponse

from service.api.app import create_app
from service.api.context import Service, ServiceDep
from service.api.job_routes import JobResource
from service.api.models import IdempotencyKeyHeader, Job
from service.jobs.process import ProcessEngine
from service.kinds.base import Model
from service.kinds.queued import QUEUED
from service.logs import set_up_logging
from service.server import serve
from service.settings import read_settings
from service.store.idempotency import IdempotencyKey
from service.store.jobrecords import NewJob


class CountJob(Job[Counted]):
    pass


class CountPage(Model):
    items: list[CountJob]
    next: int | None


router = APIRouter()
resource = JobResource(COUNT, "counts", CountJob, CountPage)


@router.post("/v1/counts", status_code=201, response_model=CountJob)
def add_count(
    request: CountRequest, response: Response, service: ServiceDep, key: IdempotencyKeyHeader = None
) -> Job[Counted]:
    record = service.store.jobs.create(
        NewJob("count", request.model_dump()),
        max_pending=service.settings.max_queued_jobs,
        idempotency_key=IdempotencyKey("count", key) if key else None,
        request_sha256=request.model_dump_json(),
    )
    service.jobs.wake()
    response.headers["Location"] = resource.location(record)
    return resource.document(record)


@router.get("/v1/counts/endless")
def count_for_ever() -> StreamingResponse:
    return StreamingResponse(itertools.repeat(b"0" * (1 << 16)), media_type="text/plain")


resource.add_to(router)


def make(service: Service) -> FastAPI:
    app = create_app(service)
    app.include_router(router)
    return app


def say(url: str) -> None:
    sys.stdout.write(url + "\n")
    sys.stdout.flush()


def main() -> None:
    set_up_logging()
    settings = read_settings(port=0, data_dir=Path(sys.argv[1]))
    engine = ProcessEngine(settings.cancel_grace_s, program="counting_job")
    service = Service(settings, {**QUEUED, **counting_job.KINDS}, engine)
    serve(service, make(service), say)
    service.close()


if __name__ == "__main__":
    main()
