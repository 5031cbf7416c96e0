"""From a checked request to a job in the store."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from fastapi import Response
from pydantic import BaseModel

from service.api.context import Service
from service.api.job_routes import JobResource
from service.api.models import Job
from service.kinds.base import RequestT, ResultT, RunContext
from service.store.idempotency import IdempotencyKey
from service.store.jobrecords import JobInput, NewJob
from service.store.scans import ScanRecord

ModelT = TypeVar("ModelT", bound=BaseModel)


def asked(model: type[ModelT], body: ModelT) -> ModelT:
    """The part of a body that is the job's request; the rest says where the files are."""
    own = body.model_dump(mode="json", by_alias=True, exclude_unset=True, include=_keys(model))
    return model.model_validate_json(json.dumps(own))


def _keys(model: type[BaseModel]) -> set[str]:
    return set(model.model_fields)


@dataclass(frozen=True)
class Submission(Generic[RequestT]):
    """A request with the files it is about.

    ``run`` goes with the request. Of it only where pictures are and what they are compared with
    is part of what was asked: asked again under the same key, the rest may be otherwise.
    """

    request: RequestT
    scan: ScanRecord | None = None
    inputs: tuple[JobInput, ...] = ()
    run: RunContext = field(default_factory=RunContext)

    def identity(self) -> str:
        """The hash of what was asked."""
        document = {
            "request": self.request.model_dump(mode="json", by_alias=True, exclude_unset=True),
            "scan_id": None if self.scan is None else self.scan.id,
            "inputs": {item.role: item.sha256 for item in self.inputs},
            "run": self.run.model_dump(include={"session", "captures", "reference"}),
        }
        canonical = json.dumps(document, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()


def submit(
    service: Service,
    resource: JobResource[RequestT, ResultT],
    submission: Submission[RequestT],
    idempotency_key: str | None,
    response: Response,
) -> Job[ResultT]:
    """Add the job, wake whoever runs it, and answer with its document and Location."""
    scan, kind = submission.scan, resource.kind
    more = {
        "workers": service.settings.workers_per_job,
        "scan_name": "" if scan is None else scan.filename,
    }
    run = submission.run.model_copy(update=more)
    record = service.store.jobs.create(
        NewJob(
            kind.name,
            kind.row(submission.request, run),
            None if scan is None else scan.id,
            submission.inputs,
        ),
        max_pending=service.settings.max_queued_jobs,
        idempotency_key=IdempotencyKey(kind.name, idempotency_key) if idempotency_key else None,
        request_sha256=submission.identity(),
    )
    service.jobs.wake()
    document = resource.document(record)
    response.headers["Location"] = resource.location(record)
    return document
