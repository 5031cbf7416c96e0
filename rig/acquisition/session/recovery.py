"""What a crash left behind, made whole or put aside.

A capture whose record was staged is whole, and is committed now. Of one that was armed and has no
record nobody knows whether it fired: it is listed as interrupted and its id refused from then on.
One that was never armed left nothing worth keeping.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from common.errors import InputError, NotFoundError
from rig.acquisition.session import places
from rig.acquisition.session.commit import Books, publish, set_aside, write_books
from rig.acquisition.session.jsonfiles import digest, read_model
from rig.acquisition.session.records import CaptureRecord, FileEntry, InterruptedEntry, SessionFile
from rig.acquisition.session.storage import Disk, disk_errors, file_sha256, sha256
from rig.acquisition.session.tables import tables


@dataclass(frozen=True)
class Recovery:
    """What was done, by capture id. Three empty lists: there was nothing to do."""

    committed: tuple[str, ...] = ()
    set_aside: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()


def read_books(folder: Path, disk: Disk) -> Books:
    """The session as it stands, as far as it is committed; changes nothing.

    Raises :class:`NotFoundError` where there is no session, :class:`InputError` for a damaged one.
    """
    path = folder / places.SESSION
    try:
        data = path.read_bytes()
    except (FileNotFoundError, NotADirectoryError) as error:
        raise NotFoundError(
            "session-not-found", f"{folder} is not a session", "give a session's folder"
        ) from error
    manifest = read_model(SessionFile, data, places.SESSION)
    if digest(manifest) != manifest.digest:
        raise InputError(
            "session-damaged",
            f"{path} is damaged: its digest does not fit its content",
            "restore it from a copy",
        )
    records = tuple(_record(folder, listed.record) for listed in manifest.captures)
    return Books(folder, disk, manifest, records)


def _record(folder: Path, listed: FileEntry) -> CaptureRecord:
    try:
        data = (folder / listed.path).read_bytes()
    except OSError as error:
        raise InputError(
            "session-damaged", f"{folder / listed.path} is missing", "restore it from a copy"
        ) from error
    if sha256(data) != listed.sha256:
        raise InputError(
            "session-damaged",
            f"{folder / listed.path} is not as it was written",
            "restore it from a copy",
        )
    return read_model(CaptureRecord, data, listed.path)


def recover_books(books: Books, known: InterruptedEntry | None = None) -> tuple[Books, Recovery]:
    """Deal with everything that is incomplete; doing it again changes nothing.

    ``known``: what is known of one capture, should it have to be set aside.
    """
    left = books.folder / places.INCOMPLETE
    if not left.is_dir():
        return books, Recovery()
    committed, aside, dropped = [], [], []
    for stage in sorted(left.iterdir()):
        name = stage.name
        if not stage.is_dir() or stage == books.scratch or books.committed(name) is not None:
            continue
        record = _whole_record(books, stage)
        if record is not None:
            books = publish(books, record)
            committed.append(name)
        elif (stage / places.INTENT).exists() or books.interrupted(name) is not None:
            entry = interrupted(name, "unknown", "the program was stopped")
            told = known is not None and known.capture_id == name
            books = set_aside(books, known if told and known is not None else entry)
            aside.append(name)
        else:
            dropped.append(name)
    books = _renew_tables(books)
    books.disk.remove(left)
    return books, Recovery(tuple(committed), tuple(aside), tuple(dropped))


def interrupted(capture_id: str, fate: str, why: str) -> InterruptedEntry:
    """The entry of a capture that was begun and is not committed."""
    return InterruptedEntry.model_validate(
        {
            "capture_id": capture_id,
            "fate": fate,
            "why": why,
            "at": datetime.now(UTC).astimezone().isoformat(timespec="seconds"),
            "folder": f"{places.INTERRUPTED}/{capture_id}",
        }
    )


def _whole_record(books: Books, stage: Path) -> CaptureRecord | None:
    """The record of a stage, when everything it names is there and right."""
    try:
        data = (stage / places.STAGED_RECORD).read_bytes()
        record = read_model(CaptureRecord, data, places.STAGED_RECORD)
    except (OSError, InputError):
        return None
    numbers = {known.number for known in books.records}
    sound = record.capture_id == stage.name and record.number not in numbers
    whole = sound and all(_there(books, stage, frame.file) for frame in record.frames)
    return record if whole else None


def _there(books: Books, stage: Path, listed: FileEntry) -> bool:
    staged, placed = stage / listed.path, books.folder / listed.path
    path = staged if staged.exists() else placed
    return path.is_file() and file_sha256(path) == listed.sha256


def _renew_tables(books: Books) -> Books:
    """Tables that were written for a capture that was then not committed are made anew."""
    for path, data in tables(books.records).items():
        file = books.folder / path
        if not file.is_file() or file_sha256(file) != sha256(data):
            return write_books(books)
    return books


def recover(folder: Path, disk: Disk | None = None) -> Recovery:
    """Bring a session in order after a crash. Opening one does this by itself.

    Raises :class:`ConflictError` ``session-busy`` while a program works on it.
    """
    from rig.acquisition.session.folder import Session

    with disk_errors(folder), Session.open(folder, disk) as session:
        return session.recovery
