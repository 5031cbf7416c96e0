"""Files from outside, which may be anything: scans, and archives of pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import Field

from rig.specification.sections.subject import Axis, ScanSection
from service.kinds.base import JobKind, Model, Note, Request, Result

__all__ = [
    "PICTURES_IMPORT",
    "SCAN_IMPORT",
    "Axis",
    "PictureFacts",
    "PicturesImportRequest",
    "ScanFace",
    "ScanFacts",
    "ScanImportRequest",
]


class ScanImportRequest(Request):
    """How to read a scan, and whether to draw it too."""

    options: ScanSection
    picture: bool = False

    @classmethod
    def reading(cls, options: Mapping[str, str | float]) -> Self:
        """A scan read with the named ``options`` of a rig file's ``[scan]``."""
        return cls(options=ScanSection.model_validate(options))


class ScanFace(Model):
    """Where the face of a scan is. Axes are to the subject's left, into the head and up."""

    confidence: Annotated[float, Field(description="0 to 1.")]
    nose_tip_file: list[float]
    nose_tip_rig_mm: list[float]
    axes_file: dict[str, list[float]]
    axes_rig: dict[str, list[float]]


class ScanFacts(Result):
    """What is in a scan, how it was understood, and what was changed to read it."""

    vertices: int
    faces: Annotated[int, Field(description="0 for a point cloud.")]
    extents_mm: Annotated[
        list[float], Field(description="Width, depth and height in the rig frame.")
    ]
    units: Annotated[
        str | None, Field(description="Unit of the file; null when it is none of the usual.")
    ] = None
    mm_per_unit: Annotated[float | None, Field(description="Millimetres per unit of the file.")] = (
        None
    )
    up: Annotated[list[float] | None, Field(description="Up, a direction of the file.")] = None
    front: Annotated[
        list[float] | None, Field(description="Out of the face, a direction of the file.")
    ] = None
    rig_from_file: Annotated[
        list[list[float]] | None, Field(description="Maps the file to the rig frame, mm.")
    ] = None
    face: Annotated[
        ScanFace | None, Field(description="Null when no face was found for certain.")
    ] = None
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
