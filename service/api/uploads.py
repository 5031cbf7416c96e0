"""Receives an uploaded scan and has it read before anything is kept."""

from __future__ import annotations

import re
import secrets
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

from anyio import CancelScope, to_thread
from fastapi import Request
from starlette.requests import ClientDisconnect

from geometry.errors import CancelledError, InputError, InternalError, NotFoundError, TooLargeError
from service.api.context import Service
from service.jobs.engine import JobKind, Task
from service.store import idempotency
from service.store.blobs import StagedFile, Staging
from service.store.idempotency import IdempotencyKey
from service.store.scans import ScanRecord, plain_name, scan_identity

_WRITE_BYTES = 1 << 20
_SUFFIX = re.compile(r"^\.[a-z0-9]{1,8}$")
_MEDIA_TYPE = re.compile(r"^[\w.+-]{1,80}/[\w.+-]{1,80}$")


@dataclass(frozen=True)
class Upload:
    """What is said about an upload besides its content."""

    filename: str
    media_type: str
    options: dict[str, Any]
    idempotency_key: IdempotencyKey | None

    @classmethod
    def announced(
        cls, request: Request, filename: str, options: dict[str, Any], key: str | None
    ) -> Upload:
        """From the request's line and headers. Raises :class:`InputError`."""
        name = PurePosixPath(filename.replace("\\", "/")).name
        if not _SUFFIX.match(PurePosixPath(name).suffix.lower()):
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
        if not _MEDIA_TYPE.match(media_type):
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
    _refuse_if_announced_too_large(request, service.settings.max_upload_bytes)
    async with _claimed(service, upload.idempotency_key) as stored:
        with service.store.files.stage(upload.suffix) as staging:
            await _receive(request, staging, service.settings.max_upload_bytes)
            staged = await to_thread.run_sync(staging.finish)
            if stored is not None:
                scan_id = upload.scan_id(staged)
                new = bool(idempotency.replay(stored, scan_id)["new"])
                return await to_thread.run_sync(service.store.scans.get, scan_id), new
            return await to_thread.run_sync(
                _read_and_keep, service, staged, upload, limiter=service.imports
            )


def _too_large(limit: int) -> TooLargeError:
    return TooLargeError(
        "upload",
        f"the file is larger than the {limit / (1 << 20):.0f} MiB that are accepted",
        "reduce the scan, or raise RIGWRIGHT_MAX_UPLOAD_BYTES",
    )


def _refuse_if_announced_too_large(request: Request, limit: int) -> None:
    announced = request.headers.get("content-length", "")
    if announced.isdecimal() and int(announced) > limit:
        raise _too_large(limit)


@asynccontextmanager
async def _claimed(
    service: Service, key: IdempotencyKey | None
) -> AsyncIterator[dict[str, Any] | None]:
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


async def _receive(request: Request, staging: Staging, limit: int) -> None:
    waiting, received = bytearray(), 0
    try:
        async for chunk in request.stream():
            received += len(chunk)
            if received > limit:
                raise _too_large(limit)
            waiting += chunk
            if len(waiting) >= _WRITE_BYTES:
                await to_thread.run_sync(staging.write, bytes(waiting))
                waiting.clear()
    except ClientDisconnect:
        raise InputError(
            "upload-truncated", "the upload broke off", "send the whole file again"
        ) from None
    if received == 0:
        raise InputError("scan-empty", "the upload is empty", "send the scan's bytes as the body")
    await to_thread.run_sync(staging.write, bytes(waiting))


def _read_and_keep(service: Service, staged: StagedFile, upload: Upload) -> tuple[ScanRecord, bool]:
    scan_id = upload.scan_id(staged)
    try:
        report = service.store.scans.get(scan_id).report
    except NotFoundError:
        report = _read(service, staged, upload)
    return service.store.scans.add(
        staged,
        scan_id=scan_id,
        filename=upload.filename,
        media_type=upload.media_type,
        options=upload.options,
        report=report,
        idempotency_key=upload.idempotency_key,
    )


def _read(service: Service, staged: StagedFile, upload: Upload) -> dict[str, Any]:
    """Parsing happens in a process with limits: a file from outside may be anything."""
    settings = service.settings
    kind = JobKind(
        "scan-import",
        "service.tasks.reading:import_scan",
        time_limit_s=settings.scan_time_limit_s,
        memory_limit_bytes=settings.scan_memory_limit_bytes,
    )
    folder = service.store.work_folder(f"import-{secrets.token_hex(8)}")
    link = folder / "inputs" / plain_name(upload.filename)
    try:
        for path in (folder / "files", link.parent):
            path.mkdir()
        link.symlink_to(staged.path.resolve())
        task = Task(kind, {"options": upload.options}, folder / "files", {"scan": link})
        return service.engine.run(task, lambda _: None, service.stopping)
    except CancelledError:
        raise InternalError(
            "stopping", "the service is stopping", "send the scan again later"
        ) from None
    except InternalError as error:
        if error.detail != "worker-died":
            raise
        raise InputError(
            "scan-unreadable",
            "the file brings down the program that reads it",
            "export the scan again, for example as PLY",
        ) from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)
