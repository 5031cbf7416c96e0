"""Files from outside, which may be anything: scans, and archives of pictures."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from rig.specification.sections.subject import ScanSection
from service.kinds.base import JobKind, Note, Request, Result


class ScanImportRequest(Request):
    """How to read a scan."""

    options: ScanSection


class ScanFacts(Result):
    """What is in a scan, and what was inferred or changed to read it."""

    vertices: int
    faces: Annotated[int, Field(description="0 for a point cloud.")]
    extents_mm: Annotated[
        list[float], Field(description="Width, depth and height in the rig frame.")
    ]
    notes: list[Note]


class PicturesImportRequest(Request):
    """Nothing to say: an archive of pictures speaks for itself."""


class PictureFacts(Result):
    """Which pictures are in an archive; ``bytes`` when unpacked."""

    cameras: dict[str, int]
    frames: int
    bytes: int


SCAN_IMPORT = JobKind("scan-import", ScanImportRequest, ScanFacts)
PICTURES_IMPORT = JobKind("picture-import", PicturesImportRequest, PictureFacts)
