"""Receives the body of an upload, and has it read in a process of its own."""

from __future__ import annotations

import shutil

from anyio import to_thread
from fastapi import Request
from starlette.requests import ClientDisconnect

from common.errors import CancelledError, InputError, InternalError, TooLargeError
from common.progress import ignore_progress
from service.api.context import Service
from service.jobs.engine import Task
from service.kinds.base import JobKind, RequestT, ResultT
from service.store.blobs import StagedFile, Staging

_WRITE_BYTES = 1 << 20
_NOTHING = ("the upload is empty", "send the file's bytes as the body")
_EMPTY = {
    "scan": InputError("scan-empty", *_NOTHING),
    "pictures": InputError("pictures-empty", *_NOTHING),
}
_SETTINGS = {"scan": "MAX_UPLOAD_BYTES", "pictures": "MAX_PICTURES_BYTES"}


async def receive(request: Request, staging: Staging, limit: int, what: str) -> StagedFile:
    """Write the body into ``staging``; ``what``, ``scan`` or ``pictures``, is uploaded.

    Raises :class:`TooLargeError` beyond ``limit`` bytes, before the body when it is announced,
    and :class:`InputError` for an empty or broken upload.
    """
    announced = request.headers.get("content-length", "")
    if announced.isdecimal() and int(announced) > limit:
        raise _too_large(limit, what)
    waiting, received = bytearray(), 0
    try:
        async for chunk in request.stream():
            received += len(chunk)
            if received > limit:
                raise _too_large(limit, what)
            waiting += chunk
            if len(waiting) >= _WRITE_BYTES:
                await to_thread.run_sync(staging.write, bytes(waiting))
                waiting.clear()
    except ClientDisconnect:
        raise InputError(
            "upload-truncated", "the upload broke off", "send the whole file again"
        ) from None
    if received == 0:
        raise _EMPTY[what]
    await to_thread.run_sync(staging.write, bytes(waiting))
    return await to_thread.run_sync(staging.finish)


def _too_large(limit: int, what: str) -> TooLargeError:
    return TooLargeError(
        "upload",
        f"the file is larger than the {limit / (1 << 20):.0f} MiB that are accepted",
        f"send less, or raise RIGWRIGHT_{_SETTINGS[what]}",
    )


def read_apart(
    service: Service,
    kind: JobKind[RequestT, ResultT],
    request: RequestT,
    staged: StagedFile,
    name: str,
) -> ResultT:
    """Have a file from outside, which may be anything, read in a process with limits.

    The file is the task's input ``upload``, called ``name``. Raises what the task raises.
    """
    folder = service.store.import_folder()
    link = folder / "inputs" / name
    try:
        for path in (folder / "files", link.parent):
            path.mkdir()
        link.symlink_to(staged.path.resolve())
        task = Task(kind, request, folder / "files", {"upload": link})
        return service.engine.run(task, ignore_progress, service.stopping)
    except CancelledError:
        raise InternalError(
            "stopping", "the service is stopping", "send the file again later"
        ) from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def died(error: InternalError) -> bool:
    """Whether what was read brought down the process that read it."""
    return error.detail == "worker-died"
