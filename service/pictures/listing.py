"""Which pictures there are, of which camera and which frame.

A frame is one instant: pictures of the same frame by several cameras show the targets in one
place. In a folder each camera has a folder of its name, and pictures of one frame have the same
name. A session's own records tell it of the session.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from common.errors import InputError, NotFoundError
from rig.acquisition.cameras.base import FrameStatus
from rig.acquisition.session.index import read_index
from rig.acquisition.session.marks import read_marks
from rig.acquisition.session.storage import Disk

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".webp")
LAYOUT = "put each camera's pictures into a folder of its name, as in cam01/0001.png"


@dataclass(frozen=True)
class Picture:
    """One picture of a ``camera`` at the instant ``frame``."""

    camera: str
    frame: str
    path: Path


def is_picture(name: str) -> bool:
    """Whether a file looks like a picture; hidden files and the likes of ``__MACOSX`` do not."""
    parts = PurePosixPath(name).parts
    hidden = any(part.startswith((".", "__MACOSX")) for part in parts)
    return not hidden and PurePosixPath(name).suffix.lower() in SUFFIXES


def pictures_in_folder(folder: Path) -> tuple[Picture, ...]:
    """The pictures of a folder with a folder per camera, ordered by camera and frame.

    Raises :class:`InputError` where there are none, and where two have one name.
    """
    if not folder.is_dir():
        raise InputError("pictures-folder", f"there is no folder {folder}", "check the path")
    found = [
        Picture(path.parent.name, path.stem, path)
        for path in sorted(folder.glob("*/*"))
        if is_picture(str(path.relative_to(folder))) and path.is_file()
    ]
    loose = any(is_picture(path.name) for path in folder.iterdir() if path.is_file())
    if not found:
        what = "pictures but no folders of cameras" if loose else "no pictures"
        raise InputError("pictures-none", f"{folder.name} holds {what}", LAYOUT)
    _refuse_twice(found, folder.name)
    return tuple(found)


def pictures_in_session(folder: Path, captures: Sequence[str] = ()) -> tuple[Picture, ...]:
    """The whole pictures of a session's captures; without a list of all that are not rejected.

    A picture that is rejected by itself is left out in any case.
    Raises :class:`NotFoundError` for a capture that is not there, and :class:`InputError` where
    there are no pictures.
    """
    records = {record.capture_id: record for record in read_index(folder, Disk()).records}
    unknown = [name for name in captures if name not in records]
    if unknown:
        raise NotFoundError(
            "session-capture",
            f"session {folder.name!r} has no capture {unknown[0]!r}",
            f"it has {', '.join(sorted(records)) or 'none'}",
        )
    marks = read_marks(folder)
    found = [
        Picture(frame.camera, f"{name}-{frame.shot}", folder / frame.file.path)
        for name in captures or sorted(n for n in records if not marks.rejects_capture(n))
        for frame in records[name].frames
        if not frame.raw
        and frame.status != FrameStatus.INCOMPLETE
        and not marks.rejects_picture(name, frame)
        and is_picture(PurePosixPath(frame.file.path).name)
    ]
    if not found:
        but = " but rejected ones" if marks.rejected else ""
        raise InputError(
            "pictures-none",
            f"session {folder.name!r} holds no pictures{but}",
            "take a capture first",
        )
    return tuple(sorted(found, key=lambda p: (p.camera, p.frame)))


def _refuse_twice(found: Iterable[Picture], name: str) -> None:
    seen: dict[tuple[str, str], Path] = {}
    for picture in found:
        key = picture.camera, picture.frame
        if key in seen:
            raise InputError(
                "pictures-twice",
                f"{name} holds {seen[key].name} and {picture.path.name} for camera "
                f"{picture.camera}, the same frame twice",
                "remove one",
            )
        seen[key] = picture.path
