"""Several files in one answer."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from typing import Any

from fastapi import Response

JSON = dict[Any, Any]
_NO_TIME = (1980, 1, 1, 0, 0, 0)
"""The same files give the same bytes."""

ZIP: JSON = {
    200: {"description": "The files, as a ZIP archive.", "content": {"application/zip": {}}}
}


def zipped(files: Mapping[str, bytes], name: str) -> Response:
    """The files by name in a ZIP archive called ``name``."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, content in files.items():
            entry = zipfile.ZipInfo(file, _NO_TIME)
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(packed.getvalue(), media_type="application/zip", headers=headers)
