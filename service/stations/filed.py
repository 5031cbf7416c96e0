"""What is filed in the folder of a session. Reads only: the session need not be open here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from common.errors import NotFoundError
from rig.acquisition.session.index import read_index
from rig.acquisition.session.moment import settled
from rig.acquisition.session.storage import Disk
from rig.acquisition.session.verify import verify_session
from service.kinds.sessions import CaptureRecord, FindingLine, SessionFile, SessionProof


@dataclass(frozen=True)
class FiledFile:
    """A file of a session; ``media_type`` where its record tells one."""

    path: Path
    media_type: str | None
    sha256: str


def session_manifest(folder: Path) -> SessionFile:
    """What a session holds. Raises :class:`~common.errors.InputError` where it is damaged."""
    return read_index(folder, Disk()).manifest


def capture_record(folder: Path, capture_id: str) -> CaptureRecord:
    """The record of a capture, a partial one as well. Raises :class:`NotFoundError`."""
    for record in read_index(folder, Disk()).records:
        if record.capture_id == capture_id:
            return record
    raise NotFoundError(
        "session-capture",
        f"session {folder.name!r} has no capture {capture_id!r}",
        f"see /v1/sessions/{folder.name}",
    )


def session_proof(folder: Path) -> SessionProof:
    """Prove a session whole, file by file. Takes as long as reading all of it."""
    check = verify_session(folder)
    return SessionProof(
        whole=check.whole,
        findings=[FindingLine(kind=f.kind, path=f.path, text=f.text) for f in check.findings],
        captures=check.captures,
        partial=check.partial,
        files=check.files,
        bytes=check.bytes,
    )


def filed_file(folder: Path, path: str) -> FiledFile:
    """The file that the session's records name ``path``. Raises :class:`NotFoundError`."""
    index = read_index(folder, Disk())
    known = {entry.path: entry.sha256 for entry in index.files()}
    types = {frame.file.path: frame.media_type for r in index.records for frame in r.frames}
    # Looked up among what the session lists: what is asked for is never used as a path.
    if path not in known or not (folder / path).is_file():
        raise NotFoundError(
            "session-file",
            f"session {folder.name!r} has no file {path!r}",
            f"see /v1/sessions/{folder.name}",
        )
    return FiledFile(folder / path, types.get(path), known[path])


def filed_at_once(folder: Path) -> list[tuple[str, Path | bytes]]:
    """All files of a session as it stood at one moment, by path; raises as :func:`settled`."""
    return settled(folder)
