"""Receives an uploaded scan and has it read before anything is kept."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

from anyio import CancelScope, to_thread
from fastapi import Request

from common.errors import InputError, InternalError, NotFoundError
from service.api.context import Service
from service.api.receiving import died, read_apart, receive
from service.kinds.imports import SCAN_IMPORT, ScanFacts, ScanImportRequest
from service.store import idempotency
from service.store.blobs import StagedFile
from service.store.idempotency import IdempotencyKey, StoredAnswer
from service.store.scans import ScanRecord, plain_name, scan_identity

_SUFFIX = re.compile(r"\.[a-z0-9]{1,8}")
_MEDIA_TYPE = re.compile(r"[\w.+-]{1,80}/[\w.+-]{1,80}")


@dataclass(frozen=True)
class Upload:
    """What is said about an upload besides its content."""

    filename: str
    media_type: str
    options: Mapping[str, str | float]
    idempotency_key: IdempotencyKey | None

    @classmethod
    def announced(
        cls, request: Request, filename: str, options: Mapping[str, str | float], key: str | None
    ) -> Upload:
        """From the request's line and headers. Raises :class:`InputError`."""
        name = PurePosixPath(filename.replace("\\", "/")).name
        if not _SUFFIX.fullmatch(PurePosixPath(name).suffix.lower()):
            raise InputError(
                "scan-name",
                f"the file name {name!r} does not tell what kind of file it is",
                "give one that ends in .glb, .obj, .ply, .stl, .3mf, .off or .xyz as ?filename=",
            )
        media_type = request.headers.get("content-type", "").split(";")[0].strip().lower()
        if media_type.startswith("multipart/"):
            raise InputError(
                "media-type",
                "a scan is sent as it is, not as a form",
                "send the file's bytes as the body, as with curl --data-binary @FILE",
            )
        if not _MEDIA_TYPE.fullmatch(media_type):
            media_type = "application/octet-stream"
        return cls(name, media_type, options, IdempotencyKey("scans", key) if key else None)

    @property
    def suffix(self) -> str:
        """What kind of file it is, for example ``.glb``."""
        return PurePosixPath(self.filename).suffix.lower()

    def scan_id(self, staged: StagedFile) -> str:
        """What the scan will be known by."""
        return scan_identity(staged.sha256, self.suffix, self.options)


async def take_in(service: Service, request: Request, upload: Upload) -> tuple[ScanRecord, bool]:
    """Receive, read and keep a scan; the flag tells whether it was new.

    Whatever goes wrong on the way, nothing of the upload stays.
    """
    async with _claimed(service, upload.idempotency_key) as stored:
        with service.store.files.stage(upload.suffix) as staging:
            staged = await receive(request, staging, service.settings.max_upload_bytes, "scan")
            if stored is not None:
                scan_id = upload.scan_id(staged)
                new = bool(idempotency.replay(stored, scan_id)["new"])
                return await to_thread.run_sync(service.store.scans.get, scan_id), new
            return await to_thread.run_sync(
                _read_and_keep, service, staged, upload, limiter=service.imports
            )


@asynccontextmanager
async def _claimed(
    service: Service, key: IdempotencyKey | None
) -> AsyncIterator[StoredAnswer | None]:
    if key is None:
        yield None
        return
    write = service.store.database.write
    stored = await to_thread.run_sync(write, lambda connection: idempotency.claim(connection, key))
    try:
        yield stored
    finally:
        if stored is None:
            # Shielded: a key must come free again even when the server gives the request up.
            # Answered keys are not touched.
            with CancelScope(shield=True):
                await to_thread.run_sync(
                    write, lambda connection: idempotency.release(connection, key)
                )


def _read_and_keep(service: Service, staged: StagedFile, upload: Upload) -> tuple[ScanRecord, bool]:
    scan_id = upload.scan_id(staged)
    try:
        report = service.store.scans.get(scan_id).report
    except NotFoundError:
        report = SCAN_IMPORT.result_row(_read(service, staged, upload))
    return service.store.scans.add(
        staged,
        scan_id=scan_id,
        filename=upload.filename,
        media_type=upload.media_type,
        options=dict(upload.options),
        report=report,
        idempotency_key=upload.idempotency_key,
    )


def _read(service: Service, staged: StagedFile, upload: Upload) -> ScanFacts:
    settings = service.settings
    kind = replace(
        SCAN_IMPORT,
        time_limit_s=settings.scan_time_limit_s,
        memory_limit_bytes=settings.scan_memory_limit_bytes,
    )
    request = ScanImportRequest.reading(upload.options)
    name = plain_name(upload.filename)
    try:
        return read_apart(service, kind, request, staged, name)
    except InternalError as error:
        if not died(error):
            raise
        raise InputError(
            "scan-unreadable",
            "the file brings down the program that reads it",
            "export the scan again, for example as PLY",
        ) from error
