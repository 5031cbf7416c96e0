"""From a checked request to a job in the store."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from fastapi import Response

from rig.rigfile import RigFile, rig_from_mapping
from service.api.context import Service
from service.api.job_routes import JobResource
from service.store.idempotency import IdempotencyKey
from service.store.jobrecords import NewJob
from service.store.scans import ScanRecord


def rig_for_scan(rig: RigFile, scan: ScanRecord, overrides: dict[str, Any]) -> dict[str, Any]:
    """The rig as JSON, with ``overrides``, and read with the scan's own options where it has none.

    Raises :class:`~geometry.errors.InputError` when the whole makes no sense.
    """
    document = rig.model_dump(mode="json", by_alias=True, exclude_unset=True) | overrides
    asked = document.get("scan", {})
    own = {key: value for key, value in asked.items() if value not in (None, "auto")}
    document["scan"] = {**scan.options, **own}
    rig_from_mapping(document)
    return document


def submit(
    service: Service,
    resource: JobResource,
    content: dict[str, Any],
    scan: ScanRecord,
    idempotency_key: str | None,
    response: Response,
) -> dict[str, Any]:
    """Add the job, wake whoever runs it, and answer with its document and Location."""
    asked = content | {"scan_id": scan.id}
    canonical = json.dumps(asked, sort_keys=True, separators=(",", ":"))
    record = service.store.jobs.create(
        NewJob(
            resource.kind,
            content | {"scan_name": scan.filename, "workers": service.settings.workers_per_job},
            scan.id,
        ),
        max_pending=service.settings.max_queued_jobs,
        idempotency_key=IdempotencyKey(resource.kind, idempotency_key) if idempotency_key else None,
        request_sha256=hashlib.sha256(canonical.encode()).hexdigest(),
    )
    service.jobs.wake()
    document = resource.document(record)
    response.headers["Location"] = document["links"]["self"]
    return document
