"""``/v1/sessions``: the folders that captures are filed in, and their files."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter
from fastapi.responses import FileResponse
from pydantic import Field

from common.errors import NotFoundError
from rig.acquisition.session.index import read_index
from rig.acquisition.session.records import CaptureRecord, SessionFile
from rig.acquisition.session.storage import Disk
from rig.acquisition.session.verify import verify_session
from service.api.context import ServiceDep
from service.api.models import problems
from service.kinds.base import Model

router = APIRouter(tags=["sessions"])


class SessionSummary(Model):
    """One session in short."""

    name: str
    links: dict[str, str]


class SessionList(Model):
    """All sessions, by name."""

    items: list[SessionSummary]


class FindingLine(Model):
    """One thing that is wrong with a session."""

    kind: str
    path: str
    text: str


class SessionProof(Model):
    """Whether every file of a session is there and unchanged."""

    whole: Annotated[bool, Field(description="Whether nothing was found.")]
    findings: list[FindingLine]
    captures: int
    files: int
    bytes: int


@router.get("/v1/sessions", response_model=SessionList)
def list_sessions(service: ServiceDep) -> SessionList:
    """List the sessions."""
    folders = service.rigs.session_folders()
    return SessionList(items=[SessionSummary(name=f.name, links=_links(f.name)) for f in folders])


@router.get("/v1/sessions/{session}", response_model=SessionFile, responses=problems(404, 422))
def read_session(service: ServiceDep, session: str) -> SessionFile:
    """Read what a session holds: its captures and their files."""
    return read_index(service.rigs.session_folder(session), Disk()).manifest


@router.get(
    "/v1/sessions/{session}/captures/{capture_id}",
    response_model=CaptureRecord,
    responses=problems(404, 422),
)
def read_session_capture(service: ServiceDep, session: str, capture_id: str) -> CaptureRecord:
    """Read the whole record of a capture, a partial one as well."""
    for record in read_index(service.rigs.session_folder(session), Disk()).records:
        if record.capture_id == capture_id:
            return record
    raise NotFoundError(
        "session-capture",
        f"session {session!r} has no capture {capture_id!r}",
        f"see /v1/sessions/{session}",
    )


@router.post(
    "/v1/sessions/{session}/verify", response_model=SessionProof, responses=problems(404, 422)
)
def verify(service: ServiceDep, session: str) -> SessionProof:
    """Prove a session whole, file by file. Takes as long as reading all of it."""
    check = verify_session(service.rigs.session_folder(session))
    return SessionProof(
        whole=check.whole,
        findings=[FindingLine(kind=f.kind, path=f.path, text=f.text) for f in check.findings],
        captures=check.captures,
        files=check.files,
        bytes=check.bytes,
    )


@router.get(
    "/v1/sessions/{session}/files/{path:path}",
    response_class=FileResponse,
    responses=problems(404, 422)
    | {200: {"description": "The file.", "content": {"application/octet-stream": {}}}},
)
def read_session_file(service: ServiceDep, session: str, path: str) -> FileResponse:
    """Fetch a picture or another file by the path that the session's records give it."""
    folder = service.rigs.session_folder(session)
    index = read_index(folder, Disk())
    known = {entry.path for entry in (*index.manifest.rig, *index.manifest.tables)}
    known |= {capture.record.path for capture in index.manifest.captures}
    types = {frame.file.path: frame.media_type for r in index.records for frame in r.frames}
    # Looked up among what the session lists: what is asked for is never used as a path.
    if path not in known | types.keys() or not (folder / path).is_file():
        raise NotFoundError(
            "session-file",
            f"session {session!r} has no file {path!r}",
            f"see /v1/sessions/{session}",
        )
    return FileResponse(folder / path, media_type=types.get(path))


def _links(name: str) -> dict[str, str]:
    own = f"/v1/sessions/{name}"
    return {"self": own, "files": f"{own}/files", "verify": f"{own}/verify"}
