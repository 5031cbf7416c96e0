"""Target sets: printed, or proposed for a rig and printed."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from calibration.targets.filekeys import TargetsModel
from service.kinds.base import JobKind, Request, Result
from service.kinds.defaults import PAGE

__all__ = [
    "TARGETS",
    "CarrierLine",
    "SeenByCamera",
    "TargetsModel",
    "TargetsRequest",
    "TargetsResult",
]


class TargetsRequest(Request):
    """How to print a set."""

    page: Annotated[
        str,
        Field(max_length=40, description="A4, A3, letter, 'A4 landscape', or 600x400 in mm."),
    ] = PAGE


class CarrierLine(Result):
    """One carrier of a set."""

    name: str
    kind: str
    targets: int


class SeenByCamera(Result):
    """What a camera sees of the targets that stand round the subject."""

    camera: str
    targets: int
    cells: Annotated[int, Field(description="In how many ninths of its picture.")]
    radius_px: Annotated[
        tuple[float, float], Field(description="Smallest and largest of their dots.")
    ]


class TargetsResult(Result):
    """What was printed, and what the cameras of a rig would see of it."""

    name: str
    carriers: list[CarrierLine]
    cameras: list[SeenByCamera]
    notes: list[str]


TARGETS = JobKind("targets", TargetsRequest, TargetsResult)
