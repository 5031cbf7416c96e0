"""``/v1/picture-sets``: pictures of targets that were taken elsewhere."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Query, Request, Response
from pydantic import AwareDatetime, Field

from common.errors import InputError, InternalError
from service.api.addresses import at
from service.api.context import Service, ServiceDep
from service.api.models import Cursor, Limit, problems
from service.api.receiving import died, read_apart, receive
from service.kinds.base import Model
from service.kinds.imports import PICTURES_IMPORT, PictureFacts, PicturesImportRequest
from service.store.blobs import StagedFile
from service.store.documents import DocumentRecord
from service.store.scans import plain_name

KIND = "picture-set"
PATH = "/v1/picture-sets"
router = APIRouter(tags=["picture sets"])


class PictureSet(Model):
    """Pictures of one or more cameras. The same archive is the same picture set."""

    id: str
    sha256: str
    filename: str
    size_bytes: int
    created_at: AwareDatetime
    cameras: Annotated[dict[str, int], Field(description="Number of pictures by camera.")]
    frames: Annotated[int, Field(description="Number of instants, by the pictures' names.")]
    links: dict[str, str]


class PictureSetPage(Model):
    """Picture sets, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[PictureSet]
    next: int | None


def _document(record: DocumentRecord) -> PictureSet:
    facts = PictureFacts.model_validate(record.report)
    return PictureSet(
        id=record.id,
        sha256=record.sha256,
        filename=record.filename,
        size_bytes=record.size_bytes,
        created_at=record.created_at,  # type: ignore[arg-type]
        cameras=facts.cameras,
        frames=facts.frames,
        links={"self": at(f"{PATH}/{record.id}")},
    )


_BODY = {
    "requestBody": {
        "required": True,
        "description": "A ZIP archive with a folder per camera; pictures of one instant have the "
        "same name: `cam01/0001.png`, `cam02/0001.png`.",
        "content": {
            media_type: {"schema": {"type": "string", "format": "binary"}}
            for media_type in ("application/zip", "application/octet-stream")
        },
    }
}


@router.post(
    PATH,
    status_code=201,
    response_model=PictureSet,
    responses=problems(413, 415, 422, 503, 507)
    | {200: {"model": PictureSet, "description": "The picture set was here already."}},
    openapi_extra=_BODY,
)
async def add_picture_set(
    request: Request,
    response: Response,
    service: ServiceDep,
    filename: Annotated[
        str, Query(min_length=1, max_length=200, description="Name of the archive.")
    ] = "pictures.zip",
) -> PictureSet:
    """Upload pictures in a ZIP archive with a folder per camera."""
    if request.headers.get("content-type", "").startswith("multipart/"):
        raise InputError(
            "media-type",
            "pictures are sent as one archive, not as a form",
            "send the archive's bytes as the body, as with curl --data-binary @FILE",
        )
    with service.store.files.stage(".zip") as staging:
        limit = service.settings.max_pictures_bytes
        staged = await receive(request, staging, limit, "pictures")
        record, new = await to_thread.run_sync(
            _read_and_keep, service, staged, filename, limiter=service.imports
        )
    response.status_code = 201 if new else 200
    response.headers["Location"] = at(f"{PATH}/{record.id}")
    return _document(record)


def _read_and_keep(
    service: Service, staged: StagedFile, filename: str
) -> tuple[DocumentRecord, bool]:
    settings = service.settings
    kind = replace(
        PICTURES_IMPORT,
        time_limit_s=settings.scan_time_limit_s,
        memory_limit_bytes=settings.scan_memory_limit_bytes,
    )
    name = plain_name(filename)
    try:
        facts = read_apart(service, kind, PicturesImportRequest(), staged, name)
    except InternalError as error:
        if not died(error):
            raise
        raise InputError(
            "pictures-archive", f"{name} cannot be read", "pack the pictures again"
        ) from error
    return service.store.documents.add(KIND, staged, name, kind.result_row(facts))


@router.get(PATH, response_model=PictureSetPage, responses=problems(422))
def list_picture_sets(
    service: ServiceDep, limit: Limit = 50, cursor: Cursor = None
) -> PictureSetPage:
    """List picture sets, newest first."""
    found = service.store.documents.page(KIND, limit + 1, cursor)
    shown = found[:limit]
    return PictureSetPage(
        items=[_document(record) for record in shown],
        next=shown[-1].seq if len(found) > limit else None,
    )


@router.get(PATH + "/{picture_set_id}", response_model=PictureSet, responses=problems(404))
def read_picture_set(service: ServiceDep, picture_set_id: str) -> PictureSet:
    """Read what a picture set holds."""
    return _document(service.store.documents.get(KIND, picture_set_id))


@router.delete(PATH + "/{picture_set_id}", status_code=204, responses=problems(404))
def remove_picture_set(service: ServiceDep, picture_set_id: str) -> None:
    """Remove a picture set. Calibrations and checks made from it stay."""
    service.store.documents.remove(KIND, picture_set_id)
