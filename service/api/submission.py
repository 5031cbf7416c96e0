"""From a checked request to a job in the store."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from fastapi import Response

from rig.specification.rigfile import RigFile, rig_from_mapping
from service.api.context import Service
from service.api.job_routes import JobResource
from service.store.idempotency import IdempotencyKey
from service.store.jobrecords import JobInput, NewJob
from service.store.scans import ScanRecord


def rig_for_scan(rig: RigFile, scan: ScanRecord, overrides: dict[str, Any]) -> dict[str, Any]:
    """The rig as JSON, with ``overrides``, and read with the scan's own options where it has none.

    Raises :class:`~common.errors.InputError` when the whole makes no sense.
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
    idempotency_key: str | None,
    response: Response,
    *,
    scan: ScanRecord | None = None,
    inputs: tuple[JobInput, ...] = (),
    unsaid: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Add the job, wake whoever runs it, and answer with its document and Location.

    ``unsaid`` goes with the request but is not part of what was asked: asked again under the same
    key, it may be otherwise.
    """
    scan_id = None if scan is None else scan.id
    given = {item.role: item.sha256 for item in inputs}
    asked = content | {"scan_id": scan_id} | ({"inputs": given} if given else {})
    canonical = json.dumps(asked, sort_keys=True, separators=(",", ":"))
    more = {"workers": service.settings.workers_per_job, **(unsaid or {})}
    if scan is not None:
        more["scan_name"] = scan.filename
    record = service.store.jobs.create(
        NewJob(resource.kind, content | more, scan_id, inputs),
        max_pending=service.settings.max_queued_jobs,
        idempotency_key=IdempotencyKey(resource.kind, idempotency_key) if idempotency_key else None,
        request_sha256=hashlib.sha256(canonical.encode()).hexdigest(),
    )
    service.jobs.wake()
    document = resource.document(record)
    response.headers["Location"] = document["links"]["self"]
    return document
