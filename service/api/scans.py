"""``/v1/scans``: the heads and faces to design for."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request, Response
from pydantic import AwareDatetime, Field

from service.api.addresses import at
from service.api.context import ServiceDep
from service.api.models import Cursor, IdempotencyKeyHeader, Limit, problems
from service.api.uploads import Upload, take_in
from service.kinds.base import Model
from service.kinds.imports import Axis, ScanFacts
from service.store.scans import ScanRecord

router = APIRouter(tags=["scans"])


class Scan(ScanFacts):
    """An uploaded scan. The same file, read with the same options, is the same scan."""

    id: str
    sha256: str
    filename: str
    media_type: str
    size_bytes: int
    created_at: AwareDatetime
    options: Annotated[
        dict[str, str | float],
        Field(description="How to read it, as given; a rig file may override."),
    ]
    links: dict[str, str]


class ScanPage(Model):
    """Scans, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[Scan]
    next: int | None


def _document(record: ScanRecord) -> Scan:
    return Scan.model_validate(
        {
            "id": record.id,
            "sha256": record.sha256,
            "options": record.options,
            "filename": record.filename,
            "media_type": record.media_type,
            "size_bytes": record.size_bytes,
            "created_at": record.created_at,
            **record.report,
            "links": {"self": at(f"/v1/scans/{record.id}")},
        }
    )


_ANY_BYTES = {"schema": {"type": "string", "format": "binary"}}
_BODY = {
    "requestBody": {
        "required": True,
        "description": "The bytes of the file: GLB, glTF, OBJ, PLY, STL, 3MF, OFF or XYZ.",
        "content": {"application/octet-stream": _ANY_BYTES, "model/gltf-binary": _ANY_BYTES},
    }
}


@router.post(
    "/v1/scans",
    status_code=201,
    response_model=Scan,
    responses=problems(409, 413, 415, 422, 503, 507)
    | {200: {"model": Scan, "description": "The scan was here already."}},
    openapi_extra=_BODY,
)
async def add_scan(
    request: Request,
    response: Response,
    service: ServiceDep,
    filename: Annotated[
        str,
        Query(
            min_length=1,
            max_length=200,
            description="Name of the file; its ending tells the format.",
            examples=["head.glb"],
        ),
    ],
    units: Annotated[
        Literal["auto", "mm", "cm", "m", "inch"], Query(description="Unit of the file.")
    ] = "auto",
    up: Annotated[Axis, Query(description="Axis of the file that points up.")] = "auto",
    front: Annotated[
        Axis,
        Query(description="Axis of the file that the face looks along."),
    ] = "auto",
    subject: Annotated[
        Literal["head", "object"], Query(description="`object` takes anything, not only a head.")
    ] = "head",
    idempotency_key: IdempotencyKeyHeader = None,
) -> Scan:
    """Upload a scan. It is read before it is kept, and what was inferred or changed is told.

    What is left at `auto` is inferred.
    """
    options = {"units": units, "up": up, "front": front, "subject": subject}
    given = {name: value for name, value in options.items() if value not in ("auto", "head")}
    upload = Upload.announced(request, filename, given, idempotency_key)
    record, new = await take_in(service, request, upload)
    response.status_code = 201 if new else 200
    response.headers["Location"] = at(f"/v1/scans/{record.id}")
    return _document(record)


@router.get("/v1/scans", response_model=ScanPage, responses=problems(422))
def list_scans(service: ServiceDep, limit: Limit = 50, cursor: Cursor = None) -> ScanPage:
    """List scans, newest first."""
    found = service.store.scans.page(limit + 1, cursor)
    shown = found[:limit]
    return ScanPage(
        items=[_document(record) for record in shown],
        next=shown[-1].seq if len(found) > limit else None,
    )


@router.get("/v1/scans/{scan_id}", response_model=Scan, responses=problems(404))
def read_scan(service: ServiceDep, scan_id: str) -> Scan:
    """Read what is known of a scan."""
    return _document(service.store.scans.get(scan_id))


@router.delete("/v1/scans/{scan_id}", status_code=204, responses=problems(404, 409))
def remove_scan(service: ServiceDep, scan_id: str) -> None:
    """Remove a scan. Designs made from it stay; a job that has not ended still needs it: 409."""
    service.store.scans.remove(scan_id)
