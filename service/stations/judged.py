"""What is thought of filed pictures: by the program how they look, by people which are rejected."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Annotated

from pydantic import Field

from common.errors import NotFoundError
from rig.acquisition.cameras.base import FrameStatus
from rig.acquisition.cameras.wholeness import is_whole
from rig.acquisition.imaging import decoded
from rig.acquisition.looks import look_at
from rig.acquisition.session.index import SessionIndex, read_index
from rig.acquisition.session.marks import (
    MarksFile,
    RejectedEntry,
    holds,
    read_marks,
    write_marks,
)
from rig.acquisition.session.records import FrameEntry
from rig.acquisition.session.storage import Disk
from service.kinds.base import Figure, Result

_KEPT = 4096
_marking = threading.Lock()


class FiledLook(Result):
    """How a filed picture looks, without a person."""

    path: str
    whole: Annotated[bool, Field(description="Whether it came as a whole, and its file is whole.")]
    sharp: Annotated[
        bool | None, Field(description="Null where it shows no edges, or cannot be read here.")
    ]
    blur_px: Annotated[
        Figure, Field(description="Spread of the sharper edges amid it; sharp is at most 1.5.")
    ]
    image_size_px: tuple[int, int] | None
    warnings: Annotated[list[str], Field(description="What is wrong with the exposure.")]


@dataclass(frozen=True)
class Place:
    """Pictures of a capture: of one camera or of all, of one shot or of all."""

    capture_id: str
    camera: str | None = None
    shot: int | None = None


def picture_of(folder: Path, path: str) -> FrameEntry:
    """The picture that a record of a session names ``path``. Raises :class:`NotFoundError`."""
    return _frame(read_index(folder, Disk()), path)


def filed_look(folder: Path, path: str) -> FiledLook:
    """Look at the picture that a record names ``path``. Raises :class:`NotFoundError`.

    A large picture takes a core for half a second.
    """
    frame = picture_of(folder, path)
    seen = _seen(folder / path, frame.file.sha256)
    came = frame.status != FrameStatus.INCOMPLETE
    return seen.model_copy(update={"path": path, "whole": seen.whole and came})


@lru_cache(maxsize=_KEPT)
def _seen(path: Path, sha256: str) -> FiledLook:
    """Of a file with that content, which never changes."""
    del sha256
    pixels = decoded(picture_bytes(path))
    look = None if pixels is None else look_at(pixels)
    return FiledLook(
        path="",
        whole=is_whole(path),
        sharp=None if look is None else look.sharp,
        blur_px=None if look is None else look.blur_px,
        image_size_px=None if look is None else look.size_px,
        warnings=[] if look is None else list(look.warnings),
    )


def picture_bytes(path: Path) -> bytes:
    """A filed picture as it is. Raises :class:`NotFoundError` for one that was removed since."""
    try:
        return path.read_bytes()
    except FileNotFoundError as error:
        raise NotFoundError(
            "session-file", f"the picture {path.name!r} is not there any more", "see /v1/sessions"
        ) from error


def _frame(index: SessionIndex, path: str) -> FrameEntry:
    for record in index.records:
        for frame in record.frames:
            if frame.file.path == path and (index.folder / path).is_file():
                return frame
    raise NotFoundError(
        "session-file",
        f"session {index.folder.name!r} has no picture {path!r}",
        f"see /v1/sessions/{index.folder.name}",
    )


def session_marks(folder: Path) -> MarksFile:
    """All marks of a session."""
    read_index(folder, Disk())
    return read_marks(folder)


def rejected(folder: Path, place: Place, why: str, by: str) -> MarksFile:
    """Reject pictures; the marks there are then. Raises :class:`NotFoundError` for no picture."""
    _there(folder, place)
    at = datetime.now(UTC).isoformat(timespec="seconds")
    mark = RejectedEntry(
        capture_id=place.capture_id,
        camera=place.camera,
        shot=place.shot,
        why=why,
        by=by,
        at=at,
    )
    with _marking:
        marks = read_marks(folder).without(mark.place)
        marks = marks.model_copy(update={"rejected": [*marks.rejected, mark]})
        write_marks(folder, marks)
    return marks


def accepted(folder: Path, place: Place) -> MarksFile:
    """Take back the mark of just that place, if there is one; the marks there are then."""
    _there(folder, place)
    with _marking:
        before = read_marks(folder)
        marks = before.without((place.capture_id, place.camera, place.shot))
        if marks != before:
            write_marks(folder, marks)
    return marks


def _there(folder: Path, place: Place) -> None:
    record = read_index(folder, Disk()).committed(place.capture_id)
    if record is None or not holds(record, place.camera, place.shot):
        raise NotFoundError(
            "session-capture",
            f"session {folder.name!r} has no such picture of a capture {place.capture_id!r}",
            f"see /v1/sessions/{folder.name}",
        )
