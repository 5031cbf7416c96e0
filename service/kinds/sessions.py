"""What sessions hold: their records as they are filed, and the proof that they are whole."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from rig.acquisition.session.marks import MarksFile
from rig.acquisition.session.records import CaptureId, CaptureRecord, SessionFile
from service.kinds.base import Model

__all__ = [
    "CaptureId",
    "CaptureRecord",
    "FindingLine",
    "MarksFile",
    "SessionFile",
    "SessionProof",
]


class FindingLine(Model):
    """One thing that is wrong with a session."""

    kind: str
    path: str
    text: str


class SessionProof(Model):
    """Whether every file of a session is there and unchanged."""

    whole: Annotated[bool, Field(description="Whether nothing was found.")]
    findings: list[FindingLine]
    captures: int
    partial: Annotated[int, Field(description="How many of the captures lack pictures.")]
    files: int
    bytes: int
