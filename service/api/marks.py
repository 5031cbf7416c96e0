"""Marks and looks of sessions: which pictures are good, to people and to the program."""

from __future__ import annotations

from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Query, Request
from pydantic import Field

from service.api.context import ServiceDep
from service.api.door import name_of
from service.api.models import problems
from service.api.targetsets import target_file
from service.kinds.base import Id, Model
from service.kinds.sessions import MarksFile
from service.stations.fields import FieldSeen, field_seen
from service.stations.judged import (
    FiledLook,
    Place,
    accepted,
    filed_look,
    rejected,
    session_marks,
)

router = APIRouter(tags=["sessions"])
_CAPTURE = "/v1/sessions/{session}/captures/{capture_id}"


class PicturesBody(Model):
    """Which pictures of a capture."""

    camera: Annotated[
        str | None, Field(max_length=200, description="Of one camera alone; null: of all.")
    ] = None
    shot: Annotated[int | None, Field(ge=1, le=1000, description="Of one shot; null: of all.")] = (
        None
    )

    def place(self, capture_id: str) -> Place:
        """Of that capture."""
        return Place(capture_id, self.camera, self.shot)


class RejectBody(PicturesBody):
    """Which pictures of a capture are no good, and why."""

    why: Annotated[str, Field(max_length=200)] = ""


@router.get("/v1/sessions/{session}/marks", response_model=MarksFile, responses=problems(404, 422))
def read_session_marks(service: ServiceDep, session: str) -> MarksFile:
    """Read which pictures of a session are rejected."""
    return session_marks(service.rigs.session_folder(session))


@router.post(
    _CAPTURE + "/reject", response_model=MarksFile, responses=problems(400, 404, 413, 422, 507)
)
def reject_pictures(
    service: ServiceDep, http: Request, session: str, capture_id: str, body: RejectBody
) -> MarksFile:
    """Reject a capture, or pictures of it. The mark stays with the session; no picture is removed.

    What is made from all captures of a session leaves rejected ones out. Answers with all marks.
    """
    folder = service.rigs.session_folder(session)
    return rejected(folder, body.place(capture_id), body.why, name_of(http.scope))


@router.post(
    _CAPTURE + "/accept", response_model=MarksFile, responses=problems(400, 404, 413, 422, 507)
)
def accept_pictures(
    service: ServiceDep, session: str, capture_id: str, body: PicturesBody
) -> MarksFile:
    """Take a mark back: the one with this camera and this shot. Answers with all marks."""
    return accepted(service.rigs.session_folder(session), body.place(capture_id))


@router.get(
    "/v1/sessions/{session}/looks/{path:path}",
    response_model=FiledLook,
    responses=problems(404, 422),
)
async def read_look(service: ServiceDep, session: str, path: str) -> FiledLook:
    """Look whether a picture is sharp and whole, by the path that its capture's record gives.

    One is looked at at a time; what was seen of a picture is kept.
    """

    def look() -> FiledLook:
        return filed_look(service.rigs.session_folder(session), path)

    return await to_thread.run_sync(look, limiter=service.looks)


@router.get(
    "/v1/sessions/{session}/fields/{path:path}",
    response_model=FieldSeen,
    responses=problems(404, 422),
)
async def read_field(
    service: ServiceDep, session: str, path: str, target_set_id: Annotated[Id, Query()]
) -> FieldSeen:
    """Look where a picture shows targets, by the path that its capture's record gives.

    All pictures of a camera together tell which part of its field is still empty. One is looked
    at at a time; what was seen of a picture is kept.
    """

    def look() -> FieldSeen:
        targets = target_file(service, target_set_id)
        return field_seen(service.rigs.session_folder(session), path, targets)

    return await to_thread.run_sync(look, limiter=service.looks)
