"""Whether a session folder is whole: every file there, unchanged, and none that nobody knows.

Reads only, so that a copy on read-only media can be proved as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from common.errors import InputError
from rig.acquisition.session import places
from rig.acquisition.session.commit import Books
from rig.acquisition.session.records import CaptureEntry, CaptureRecord, FileEntry
from rig.acquisition.session.recovery import read_books
from rig.acquisition.session.storage import Disk, file_sha256, sha256
from rig.acquisition.session.tables import tables


class FindingKind(StrEnum):
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
class Finding:
    """One thing that is wrong, and with which file."""

    kind: FindingKind
    path: str
    text: str


@dataclass(frozen=True)
class SessionCheck:
    """The result: whole when nothing was found."""

    findings: tuple[Finding, ...]
    captures: int = 0
    files: int = 0
    bytes: int = 0

    @property
    def whole(self) -> bool:
        """Whether nothing is wrong."""
        return not self.findings


def verify_session(folder: Path) -> SessionCheck:
    """Prove a session whole, file by file.

    Raises :class:`NotFoundError` where there is no session.
    """
    try:
        books = read_books(folder, Disk())
    except InputError as error:
        return SessionCheck((Finding(FindingKind.DAMAGED, places.SESSION, error.problem),))
    listed = list(_listed(books))
    findings = [
        *_files(folder, listed),
        *_tables(books),
        *_contradictions(books),
        *_extras(folder, {entry.path for entry in listed}),
    ]
    size = sum(entry.bytes for entry in listed)
    return SessionCheck(tuple(findings), len(books.records), len(listed) + 1, size)


def _listed(books: Books) -> Iterator[FileEntry]:
    """Every file the session knows, ``session.json`` itself aside."""
    yield from books.manifest.rig
    yield from books.manifest.tables
    yield from (listed.record for listed in books.manifest.captures)
    for record in books.records:
        yield from (frame.file for frame in record.frames)


def _files(folder: Path, listed: Iterable[FileEntry]) -> Iterator[Finding]:
    for entry in listed:
        path = folder / entry.path
        if path.is_symlink() or not path.is_file():
            yield Finding(FindingKind.MISSING, entry.path, f"{entry.path} is missing")
        elif path.stat().st_size != entry.bytes or file_sha256(path) != entry.sha256:
            text = f"{entry.path} is not as it was written"
            yield Finding(FindingKind.CHANGED, entry.path, text)


def _tables(books: Books) -> Iterator[Finding]:
    known = {entry.path: entry.sha256 for entry in books.manifest.tables}
    for path, data in tables(books.records).items():
        if known.get(path) != sha256(data):
            text = f"{path} does not say what the records of the captures say"
            yield Finding(FindingKind.CONTRADICTION, path, text)


def _contradictions(books: Books) -> Iterator[Finding]:
    seen: dict[str, str] = {}
    for listed, record in zip(books.manifest.captures, books.records, strict=True):
        path = listed.record.path
        if not _agree(listed, record):
            text = f"{path} and session.json contradict each other"
            yield Finding(FindingKind.CONTRADICTION, path, text)
        for frame in record.frames:
            suffix = Path(frame.file.path).suffix
            place = places.picture(frame.camera, frame.instant, suffix, raw=frame.raw)
            other = seen.setdefault(frame.file.path, record.capture_id)
            if place != frame.file.path or other != record.capture_id:
                text = f"{frame.file.path} is not where a picture of its camera and instant lies"
                yield Finding(FindingKind.CONTRADICTION, frame.file.path, text)


def _agree(listed: CaptureEntry, record: CaptureRecord) -> bool:
    same = ("capture_id", "number", "state", "fired_at", "first_instant", "shots", "verdict")
    pictures = sum(not frame.raw for frame in record.frames)
    place = places.record(record.number, record.capture_id)
    return (
        all(getattr(listed, key) == getattr(record, key) for key in same)
        and listed.pictures == pictures
        and listed.record.path == place
    )


def _extras(folder: Path, known: set[str]) -> Iterator[Finding]:
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        top = name.split("/", 1)[0]
        if top == places.INTERRUPTED or (path.is_dir() and not path.is_symlink()):
            continue
        if top == places.INCOMPLETE:
            text = "a capture is being written, or was when the program was stopped"
            yield Finding(FindingKind.INTERRUPTED, name, text)
        elif name not in known and name != places.SESSION:
            yield Finding(FindingKind.EXTRA, name, f"{name} belongs to no capture")
