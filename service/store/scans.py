"""Scans: uploaded files, known by their content and by how it is to be read."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from sqlalchemy import Connection, RowMapping, delete, exists, insert, select

from common.errors import ConflictError, NotFoundError
from service.store.blobs import Blobs, StagedFile
from service.store.database import Database
from service.store.idempotency import IdempotencyKey, answer
from service.store.tables import JobStatus, blobs, jobs, scans, utc_now


@dataclass(frozen=True)
class ScanRecord:
    """What is known of an uploaded scan. ``options`` tell how to read it."""

    seq: int
    id: str
    sha256: str
    filename: str
    media_type: str
    options: dict[str, Any]
    size_bytes: int
    report: dict[str, Any]
    created_at: str

    @property
    def plain_name(self) -> str:
        """See :func:`plain_name`."""
        return plain_name(self.filename)


def plain_name(filename: str) -> str:
    """A name for the file that any file system takes, close to the one it was given.

    Readers tell formats apart by the suffix and name the file in their messages.
    """
    path = PurePosixPath(filename)
    stem = re.sub(r"[^A-Za-z0-9._-]", "_", path.stem)[:80]
    return f"{stem}{path.suffix.lower()}"


def scan_identity(sha256: str, suffix: str, options: Mapping[str, Any]) -> str:
    """The id of a scan: the same file, read in the same way, is the same scan."""
    known_by = json.dumps([sha256, suffix, dict(options)], sort_keys=True)
    return hashlib.sha256(known_by.encode()).hexdigest()


class Scans:
    """The scans of a store."""

    def __init__(self, database: Database, files: Blobs) -> None:
        self._database = database
        self._files = files

    def add(
        self,
        staged: StagedFile,
        *,
        scan_id: str,
        filename: str,
        media_type: str,
        options: dict[str, Any],
        report: dict[str, Any],
        idempotency_key: IdempotencyKey | None = None,
    ) -> tuple[ScanRecord, bool]:
        """Keep a scan; the flag tells whether it is new. The same content is kept once."""

        def change(connection: Connection) -> tuple[ScanRecord, bool]:
            found = connection.execute(_SCANS.where(scans.c.id == scan_id)).mappings()
            row = found.one_or_none()
            new = row is None
            if new:
                self._files.adopt(connection, staged)
                connection.execute(
                    insert(scans).values(
                        id=scan_id,
                        blob_sha256=staged.sha256,
                        filename=filename,
                        media_type=media_type,
                        options=options,
                        report=report,
                        created_at=utc_now(),
                    )
                )
            if idempotency_key is not None:
                answer(connection, idempotency_key, scan_id, {"new": new})
            return self._one(connection, scan_id), new

        return self._database.write(change)

    def get(self, scan_id: str) -> ScanRecord:
        """One scan. Raises :class:`NotFoundError`."""
        return self._database.read(lambda connection: self._one(connection, scan_id))

    def page(self, limit: int, before: int | None) -> list[ScanRecord]:
        """Newest first; ``before`` is the ``seq`` at which the page before ended."""
        query = _SCANS.order_by(scans.c.seq.desc()).limit(limit)
        if before is not None:
            query = query.where(scans.c.seq < before)
        return self._database.read(
            lambda connection: [_record(row) for row in connection.execute(query).mappings()]
        )

    def path(self, scan: ScanRecord) -> Path:
        """Where the file of a scan is kept."""
        return self._files.path(scan.sha256)

    def remove(self, scan_id: str) -> None:
        """Remove a scan and its file. Refused while a job still needs it."""
        unused: list[str] = []

        def change(connection: Connection) -> None:
            self._one(connection, scan_id)
            active = jobs.c.status.in_([JobStatus.PENDING, JobStatus.RUNNING])
            if connection.scalar(select(exists().where(jobs.c.scan_id == scan_id, active))):
                raise ConflictError(
                    "scan-in-use",
                    "a job that has not ended needs this scan",
                    "wait until the job has ended, or cancel it",
                )
            connection.execute(delete(scans).where(scans.c.id == scan_id))
            unused.extend(self._files.forget_unused(connection))

        self._database.write(change, after=lambda: self._files.remove(unused))

    @staticmethod
    def _one(connection: Connection, scan_id: str) -> ScanRecord:
        row = connection.execute(_SCANS.where(scans.c.id == scan_id)).mappings().one_or_none()
        if row is None:
            raise NotFoundError(
                "scan", f"there is no scan {scan_id!r}", "list the scans, or upload the file again"
            )
        return _record(row)


_SCANS = select(
    scans.c.seq,
    scans.c.id,
    blobs.c.sha256,
    scans.c.filename,
    scans.c.media_type,
    scans.c.options,
    blobs.c.size_bytes,
    scans.c.report,
    scans.c.created_at,
).join_from(scans, blobs, scans.c.blob_sha256 == blobs.c.sha256)


def _record(row: RowMapping) -> ScanRecord:
    return ScanRecord(**row)
