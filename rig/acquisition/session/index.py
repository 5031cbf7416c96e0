"""A session as its folder has it: the manifest, and the records it lists."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from common.errors import InputError, NotFoundError
from common.files.reading import plain_bytes
from rig.acquisition.session import paths
from rig.acquisition.session.jsonfiles import digest, read_model
from rig.acquisition.session.records import CaptureRecord, FileEntry, InterruptedEntry, SessionFile
from rig.acquisition.session.storage import Disk, sha256
from rig.acquisition.session.tables import TableRows


@dataclass(frozen=True, eq=False)
class SessionIndex:
    """A session as it stands on the disk: its folder, its manifest, its records in order."""

    folder: Path
    disk: Disk
    manifest: SessionFile
    records: tuple[CaptureRecord, ...]
    rows: tuple[TableRows, ...] = ()
    """What the first of the records add to the tables, as far as that has been made."""

    def committed(self, capture_id: str) -> CaptureRecord | None:
        """The record of a committed capture."""
        return next((r for r in self.records if r.capture_id == capture_id), None)

    def interrupted(self, capture_id: str) -> InterruptedEntry | None:
        """The entry of a capture that was begun and not committed."""
        found = (e for e in self.manifest.interrupted if e.capture_id == capture_id)
        return next(found, None)

    def files(self) -> Iterator[FileEntry]:
        """Every file the session knows, ``session.json`` itself aside."""
        yield from self.manifest.rig
        yield from self.manifest.tables
        yield from (listed.record for listed in self.manifest.captures)
        for record in self.records:
            yield from (frame.file for frame in record.frames)

    @property
    def scratch(self) -> Path:
        """Where halves of files are written."""
        return self.folder / paths.SCRATCH


def read_index(folder: Path, disk: Disk) -> SessionIndex:
    """The session as it stands, as far as it is committed; changes nothing.

    Raises :class:`NotFoundError` where there is no session, :class:`InputError` for a damaged one.
    """
    path = folder / paths.SESSION
    try:
        data = plain_bytes(path)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise NotFoundError(
            "session-not-found", f"{folder} is not a session", "give a session's folder"
        ) from error
    except OSError as error:
        if path.is_file():
            raise
        raise InputError(
            "session-damaged", f"{path} is no plain file", "restore it from a copy"
        ) from error
    manifest = read_model(SessionFile, data, paths.SESSION)
    if digest(manifest) != manifest.digest:
        raise InputError(
            "session-damaged",
            f"{path} is damaged: its digest does not fit its content",
            "restore it from a copy",
        )
    records = tuple(_record(folder, listed.record) for listed in manifest.captures)
    return SessionIndex(folder, disk, manifest, records)


def _record(folder: Path, listed: FileEntry) -> CaptureRecord:
    try:
        data = plain_bytes(folder / listed.path)
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
