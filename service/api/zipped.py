"""Several files in one answer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZIP_STORED

from fastapi import Response
from fastapi.responses import StreamingResponse
from zipstream import ZipStream

from common.files.zip import zip_bytes
from service.api.responses import BINARY, Responses

ZIP: Responses = {
    200: {
        "description": "The files, as a ZIP archive.",
        "content": {"application/zip": {"schema": BINARY}},
    }
}


def zipped(files: Mapping[str, bytes], name: str) -> Response:
    """Small files by name in a ZIP archive called ``name``."""
    return Response(zip_bytes(files), media_type="application/zip", headers=_named(name))


def streamed(
    files: Iterable[tuple[str, Path | bytes]], name: str, *, pictures: bool
) -> StreamingResponse:
    """Files on disk, of any size, in a ZIP archive called ``name`` that is made as it is sent.

    ``pictures``: they do not shrink, so they are stored as they are, and the archive's length is
    told before. The files must not change meanwhile; where one does, the answer breaks off.
    """
    archive = ZipStream(compress_type=ZIP_STORED if pictures else ZIP_DEFLATED, sized=pictures)
    for inside, content in files:
        if isinstance(content, bytes):
            archive.add(content, inside)
        else:
            archive.add_path(content, inside)
    headers = _named(name)
    if pictures:
        headers["Content-Length"] = str(len(archive))
    return StreamingResponse(archive, media_type="application/zip", headers=headers)


def _named(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"'}
