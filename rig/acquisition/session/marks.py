"""What people think of a session's pictures: which of them are rejected.

``marks.json`` lies beside ``session.json`` and may change after a capture was committed: no
checksum of the session covers it, and a session without one has no marks.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from common.errors import InputError
from common.files.reading import plain_bytes
from common.files.strict import StrictModel
from common.files.writing import write_whole
from rig.acquisition.session import paths
from rig.acquisition.session.jsonfiles import model_bytes, read_model
from rig.acquisition.session.records import CaptureId, CaptureRecord, FrameEntry

SCHEMA: Literal["rigwright.marks/1"] = "rigwright.marks/1"


class RejectedEntry(StrictModel):
    """What was rejected: of a capture all, or the pictures of one camera, or of one shot."""

    capture_id: CaptureId = Field(description="Whose pictures.")
    camera: str | None = Field(description="Of this camera alone; null: of all.")
    shot: int | None = Field(ge=1, description="Of this shot alone; null: of all.")
    why: str = Field(max_length=200, description="What was wrong with it.")
    by: str = Field(max_length=200, description="Whose key asked for it; empty: nobody's.")
    at: str = Field(description="When, ISO 8601 with offset.")

    @property
    def place(self) -> tuple[str, str | None, int | None]:
        """What it is about: there is one mark of a place at most."""
        return self.capture_id, self.camera, self.shot

    def covers(self, capture_id: str, frame: FrameEntry) -> bool:
        """Whether it rejects that picture."""
        return (
            self.capture_id == capture_id
            and self.camera in (None, frame.camera)
            and self.shot in (None, frame.shot)
        )


class MarksFile(StrictModel):
    """The root of ``marks.json``."""

    schema_: Literal["rigwright.marks/1"] = Field(
        alias="schema", description="Version of the format."
    )
    rejected: list[RejectedEntry] = Field(description="In the order in which they were made.")

    def without(self, place: tuple[str, str | None, int | None]) -> MarksFile:
        """The same with no mark of that place."""
        return self.model_copy(
            update={"rejected": [mark for mark in self.rejected if mark.place != place]}
        )

    def rejects_capture(self, capture_id: str) -> bool:
        """Whether a capture is rejected as a whole."""
        return any(mark.place == (capture_id, None, None) for mark in self.rejected)

    def rejects_picture(self, capture_id: str, frame: FrameEntry) -> bool:
        """Whether a picture is rejected by more than its whole capture's mark."""
        return any(
            mark.covers(capture_id, frame) and mark.place != (capture_id, None, None)
            for mark in self.rejected
        )


def read_marks(folder: Path) -> MarksFile:
    """The marks of a session; none where there is no file. Raises :class:`InputError`."""
    path = folder / paths.MARKS
    try:
        data = plain_bytes(path)
    except FileNotFoundError:
        return MarksFile(schema=SCHEMA, rejected=[])
    except OSError as error:
        raise InputError(
            "session-marks", f"{path} cannot be read ({error.strerror})", "restore it from a copy"
        ) from error
    return read_model(MarksFile, data, paths.MARKS)


def write_marks(folder: Path, marks: MarksFile) -> None:
    """Replace the marks of a session. Raises :class:`InputError` where that cannot be."""
    write_whole(folder / paths.MARKS, model_bytes(marks), overwrite=True)


def holds(record: CaptureRecord, camera: str | None, shot: int | None) -> bool:
    """Whether a capture has a picture of that camera and shot, each null for any."""
    return any(
        camera in (None, frame.camera) and shot in (None, frame.shot) for frame in record.frames
    )
