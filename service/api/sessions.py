"""``/v1/sessions``: the folders that captures are filed in, and their files."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import FileResponse

from service.api.context import ServiceDep
from service.api.models import problems
from service.kinds.base import Model
from service.kinds.sessions import CaptureRecord, SessionFile, SessionProof
from service.stations.filed import capture_record, filed_file, session_manifest, session_proof

router = APIRouter(tags=["sessions"])


class SessionSummary(Model):
    """One session in short."""

    name: str
    links: dict[str, str]


class SessionList(Model):
    """All sessions, by name."""

    items: list[SessionSummary]


@router.get("/v1/sessions", response_model=SessionList)
def list_sessions(service: ServiceDep) -> SessionList:
    """List the sessions."""
    folders = service.rigs.session_folders()
    return SessionList(items=[SessionSummary(name=f.name, links=_links(f.name)) for f in folders])


@router.get("/v1/sessions/{session}", response_model=SessionFile, responses=problems(404, 422))
def read_session(service: ServiceDep, session: str) -> SessionFile:
    """Read what a session holds: its captures and their files."""
    return session_manifest(service.rigs.session_folder(session))


@router.get(
    "/v1/sessions/{session}/captures/{capture_id}",
    response_model=CaptureRecord,
    responses=problems(404, 422),
)
def read_session_capture(service: ServiceDep, session: str, capture_id: str) -> CaptureRecord:
    """Read the whole record of a capture, a partial one as well."""
    return capture_record(service.rigs.session_folder(session), capture_id)


@router.post(
    "/v1/sessions/{session}/verify", response_model=SessionProof, responses=problems(404, 422)
)
def verify(service: ServiceDep, session: str) -> SessionProof:
    """Prove a session whole, file by file. Takes as long as reading all of it."""
    return session_proof(service.rigs.session_folder(session))


@router.get(
    "/v1/sessions/{session}/files/{path:path}",
    response_class=FileResponse,
    responses=problems(404, 422)
    | {200: {"description": "The file.", "content": {"application/octet-stream": {}}}},
)
def read_session_file(service: ServiceDep, session: str, path: str) -> FileResponse:
    """Fetch a picture or another file by the path that the session's records give it."""
    file = filed_file(service.rigs.session_folder(session), path)
    return FileResponse(file.path, media_type=file.media_type)


def _links(name: str) -> dict[str, str]:
    own = f"/v1/sessions/{name}"
    return {"self": own, "files": f"{own}/files", "verify": f"{own}/verify"}
