"""``/v1/sessions``: the folders that captures are filed in, and their files."""

from __future__ import annotations

from urllib.parse import quote

from fastapi import APIRouter
from fastapi.responses import StreamingResponse

from service.api.addresses import at
from service.api.conditional import StoredFile
from service.api.context import ServiceDep
from service.api.models import problems
from service.api.responses import a_file
from service.api.zipped import ZIP, streamed
from service.kinds.base import Model
from service.kinds.sessions import CaptureRecord, SessionFile, SessionProof
from service.stations.filed import (
    capture_record,
    filed_at_once,
    filed_file,
    session_manifest,
    session_proof,
)

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
    return SessionList(items=[summary(folder.name) for folder in service.rigs.session_folders()])


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
def verify_session_files(service: ServiceDep, session: str) -> SessionProof:
    """Prove a session whole, file by file. Takes as long as reading all of it."""
    return session_proof(service.rigs.session_folder(session))


@router.get(
    "/v1/sessions/{session}/files/{path:path}",
    response_class=StoredFile,
    responses=problems(404, 422) | a_file("application/octet-stream"),
)
def read_session_file(service: ServiceDep, session: str, path: str) -> StoredFile:
    """Fetch a picture or another file by the path that the session's records give it."""
    file = filed_file(service.rigs.session_folder(session), path)
    return StoredFile(file.path, file.media_type, file.sha256)


@router.get(
    "/v1/sessions/{session}/archive",
    response_class=StreamingResponse,
    responses=problems(404, 409, 422) | ZIP,
)
def read_session_archive(service: ServiceDep, session: str) -> StreamingResponse:
    """Fetch all that is committed of a session in one ZIP archive, which is a session again.

    It is made as it is sent, and its length is told before.
    """
    filed = filed_at_once(service.rigs.session_folder(session))
    files = [(f"{session}/{path}", content) for path, content in filed]
    return streamed(files, f"{session}.zip", pictures=True)


def summary(name: str) -> SessionSummary:
    """A session in short, by its name."""
    return SessionSummary(name=name, links=_links(name))


def _links(name: str) -> dict[str, str]:
    own = at(f"/v1/sessions/{quote(name)}")
    return {"self": own} | {word: f"{own}/{word}" for word in ("files", "verify", "archive")}
