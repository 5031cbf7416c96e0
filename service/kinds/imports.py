"""Files from outside, which may be anything: scans, and archives of pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import Field

from rig.specification.sections.subject import Axis, ScanSection
from service.kinds.base import JobKind, Note, Request, Result

__all__ = [
    "PICTURES_IMPORT",
    "SCAN_IMPORT",
    "Axis",
    "PictureFacts",
    "PicturesImportRequest",
    "ScanFacts",
    "ScanImportRequest",
]


class ScanImportRequest(Request):
    """How to read a scan."""

    options: ScanSection

    @classmethod
    def reading(cls, options: Mapping[str, str | float]) -> Self:
        """A scan read with the named ``options`` of a rig file's ``[scan]``."""
        return cls(options=ScanSection.model_validate(options))


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
