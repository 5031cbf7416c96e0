"""Several files in one answer."""

from __future__ import annotations

from collections.abc import Mapping

from fastapi import Response

from common.files.zip import zip_bytes
from service.api.responses import Responses

ZIP: Responses = {
    200: {"description": "The files, as a ZIP archive.", "content": {"application/zip": {}}}
}


def zipped(files: Mapping[str, bytes], name: str) -> Response:
    """The files by name in a ZIP archive called ``name``."""
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(zip_bytes(files), media_type="application/zip", headers=headers)
