"""Whether a session folder is whole: every file there, unchanged, and none that nobody knows.

Reads only, so that a copy on read-only media can be proved as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from common.errors import InputError
from rig.acquisition.session import paths
from rig.acquisition.session.index import SessionIndex, read_index
from rig.acquisition.session.marks import read_marks
from rig.acquisition.session.records import CaptureEntry, CaptureRecord, FileEntry, contradictions
from rig.acquisition.session.storage import Disk, file_sha256, sha256
from rig.acquisition.session.tables import tables


class SessionFindingKind(StrEnum):
    """What can be wrong with a session."""

    DAMAGED = "damaged"
    """``session.json`` or a record cannot be believed; nothing else was looked at."""
    MISSING = "missing"
    CHANGED = "changed"
    EXTRA = "extra"
    CONTRADICTION = "contradiction"
    INTERRUPTED = "interrupted"
    """Something is still being written, or was when the program was stopped."""


@dataclass(frozen=True)
class SessionFinding:
    """One thing that is wrong, and with which file."""

    kind: SessionFindingKind
    path: str
    text: str


@dataclass(frozen=True)
class SessionCheck:
    """The result: whole when nothing was found."""

    findings: tuple[SessionFinding, ...]
    captures: int = 0
    files: int = 0
    bytes: int = 0
    partial: int = 0
    """How many of the captures lack pictures."""

    @property
    def whole(self) -> bool:
        """Whether nothing is wrong."""
        return not self.findings


def verify_session(folder: Path) -> SessionCheck:
    """Prove a session whole, file by file.

    Raises :class:`NotFoundError` where there is no session.
    """
    try:
        index = read_index(folder, Disk())
    except InputError as error:
        return SessionCheck(
            (SessionFinding(SessionFindingKind.DAMAGED, paths.SESSION, error.problem),)
        )
    listed = list(index.files())
    findings = [
        *_files(folder, listed),
        *_tables(index),
        *_contradictions(index),
        *_extras(folder, {paths.SESSION, paths.MARKS, *(entry.path for entry in listed)}),
        *_marks(folder),
    ]
    size = sum(entry.bytes for entry in listed)
    partial = sum(record.state == "partial" for record in index.records)
    return SessionCheck(tuple(findings), len(index.records), len(listed) + 1, size, partial)


def _files(folder: Path, listed: Iterable[FileEntry]) -> Iterator[SessionFinding]:
    for entry in listed:
        path = folder / entry.path
        if path.is_symlink() or not path.is_file():
            yield SessionFinding(SessionFindingKind.MISSING, entry.path, f"{entry.path} is missing")
        elif path.stat().st_size != entry.bytes or file_sha256(path) != entry.sha256:
            text = f"{entry.path} is not as it was written"
            yield SessionFinding(SessionFindingKind.CHANGED, entry.path, text)


def _marks(folder: Path) -> Iterator[SessionFinding]:
    try:
        read_marks(folder)
    except InputError as error:
        yield SessionFinding(SessionFindingKind.CHANGED, paths.MARKS, error.problem)


def _tables(index: SessionIndex) -> Iterator[SessionFinding]:
    known = {entry.path: entry.sha256 for entry in index.manifest.tables}
    for path, data in tables(index.records).items():
        if known.get(path) != sha256(data):
            text = f"{path} does not say what the records of the captures say"
            yield SessionFinding(SessionFindingKind.CONTRADICTION, path, text)


def _contradictions(index: SessionIndex) -> Iterator[SessionFinding]:
    seen: dict[str, str] = {}
    for listed, record in zip(index.manifest.captures, index.records, strict=True):
        path = listed.record.path
        if not _agree(listed, record):
            text = f"{path} and session.json contradict each other"
            yield SessionFinding(SessionFindingKind.CONTRADICTION, path, text)
        for wrong in contradictions(record):
            text = f"{path} contradicts itself: {wrong}"
            yield SessionFinding(SessionFindingKind.CONTRADICTION, path, text)
        for frame in record.frames:
            suffix = Path(frame.file.path).suffix
            place = paths.picture(frame.camera, frame.instant, suffix, raw=frame.raw)
            other = seen.setdefault(frame.file.path, record.capture_id)
            if place != frame.file.path or other != record.capture_id:
                text = f"{frame.file.path} is not where a picture of its camera and instant lies"
                yield SessionFinding(SessionFindingKind.CONTRADICTION, frame.file.path, text)


def _agree(listed: CaptureEntry, record: CaptureRecord) -> bool:
    same = ("capture_id", "number", "state", "fired_at", "first_instant", "shots", "verdict")
    pictures = sum(not frame.raw for frame in record.frames)
    place = paths.record(record.number, record.capture_id)
    return (
        all(getattr(listed, key) == getattr(record, key) for key in same)
        and listed.pictures == pictures
        and listed.record.path == place
    )


def _extras(folder: Path, known: set[str]) -> Iterator[SessionFinding]:
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        top = name.split("/", 1)[0]
        if top == paths.INTERRUPTED or (path.is_dir() and not path.is_symlink()):
            continue
        if top == paths.INCOMPLETE:
            text = "a capture is being written, or was when the program was stopped"
            yield SessionFinding(SessionFindingKind.INTERRUPTED, name, text)
        elif name not in known:
            yield SessionFinding(SessionFindingKind.EXTRA, name, f"{name} belongs to no capture")
