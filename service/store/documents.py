"""Documents that jobs work on, known by their content: target sets, pictures."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, RowMapping, delete, insert, select

from common.errors import NotFoundError
from service.store.blobs import Blobs, StagedFile
from service.store.database import Database
from service.store.jobrecords import JobInput
from service.store.scans import plain_name
from service.store.tables import blobs, documents, utc_now


@dataclass(frozen=True)
class DocumentRecord:
    """A document of some ``kind``; ``report`` is what reading it told."""

    seq: int
    id: str
    kind: str
    sha256: str
    filename: str
    size_bytes: int
    report: dict[str, Any]
    created_at: str

    def as_input(self, role: str) -> JobInput:
        """The document as a job's input."""
        return JobInput(role, plain_name(self.filename), self.sha256)


def document_identity(kind: str, sha256: str) -> str:
    """The id of a document: the same content is the same document."""
    return hashlib.sha256(f"{kind}:{sha256}".encode()).hexdigest()


class Documents:
    """The documents of a store."""

    def __init__(self, database: Database, files: Blobs) -> None:
        self._database = database
        self._files = files

    def add(
        self, kind: str, staged: StagedFile, filename: str, report: dict[str, Any]
    ) -> tuple[DocumentRecord, bool]:
        """Keep a document; the flag tells whether it is new. The same content is kept once."""
        document_id = document_identity(kind, staged.sha256)

        def change(connection: Connection) -> tuple[DocumentRecord, bool]:
            query = _DOCUMENTS.where(documents.c.id == document_id)
            row = connection.execute(query).mappings().one_or_none()
            if row is not None:
                return _record(row), False
            self._files.adopt(connection, staged)
            connection.execute(
                insert(documents).values(
                    id=document_id,
                    kind=kind,
                    blob_sha256=staged.sha256,
                    filename=filename,
                    report=report,
                    created_at=utc_now(),
                )
            )
            return self._one(connection, kind, document_id), True

        return self._database.write(change)

    def get(self, kind: str, document_id: str) -> DocumentRecord:
        """One document of a kind. Raises :class:`NotFoundError`."""
        return self._database.read(lambda connection: self._one(connection, kind, document_id))

    def page(self, kind: str, limit: int, before: int | None) -> list[DocumentRecord]:
        """Newest first; ``before`` is the ``seq`` at which the page before ended."""
        query = _DOCUMENTS.where(documents.c.kind == kind)
        query = query.order_by(documents.c.seq.desc()).limit(limit)
        if before is not None:
            query = query.where(documents.c.seq < before)
        return self._database.read(
            lambda connection: [_record(row) for row in connection.execute(query).mappings()]
        )

    def path(self, document: DocumentRecord) -> Path:
        """Where the file of a document is kept."""
        return self._files.path(document.sha256)

    def remove(self, kind: str, document_id: str) -> None:
        """Remove a document. Jobs that were given it keep what they need."""
        unused: list[str] = []

        def change(connection: Connection) -> None:
            self._one(connection, kind, document_id)
            connection.execute(delete(documents).where(documents.c.id == document_id))
            unused.extend(self._files.forget_unused(connection))

        self._database.write(change, after=lambda: self._files.remove(unused))

    @staticmethod
    def _one(connection: Connection, kind: str, document_id: str) -> DocumentRecord:
        query = _DOCUMENTS.where(documents.c.id == document_id, documents.c.kind == kind)
        row = connection.execute(query).mappings().one_or_none()
        if row is None:
            raise NotFoundError(
                kind, f"there is no {kind} {document_id!r}", f"list the {kind}s, or add it again"
            )
        return _record(row)


_DOCUMENTS = select(
    documents.c.seq,
    documents.c.id,
    documents.c.kind,
    blobs.c.sha256,
    documents.c.filename,
    blobs.c.size_bytes,
    documents.c.report,
    documents.c.created_at,
).join_from(documents, blobs, documents.c.blob_sha256 == blobs.c.sha256)


def _record(row: RowMapping) -> DocumentRecord:
    return DocumentRecord(**row)
