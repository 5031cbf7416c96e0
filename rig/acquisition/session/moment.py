"""A session as it stood at one moment, while others may go on photographing into it."""

from __future__ import annotations

import time
from pathlib import Path

from common.errors import ConflictError, InputError
from rig.acquisition.session import paths
from rig.acquisition.session.index import read_index
from rig.acquisition.session.storage import Disk, sha256

_LOOKS = 10
_PAUSE_S = 0.1
"""A capture is committed within a few milliseconds; ten looks do not all meet one."""


def settled(folder: Path) -> list[tuple[str, Path | bytes]]:
    """All files of a session by path: those that captures change as bytes, else where they lie.

    Raises :class:`NotFoundError` where there is no session, :class:`InputError` for a damaged one,
    :class:`ConflictError` while it changes all the time.
    """
    for _ in range(_LOOKS):
        before = _bytes(folder, paths.SESSION)
        index = read_index(folder, Disk())
        tables = {entry.path: _bytes(folder, entry.path) for entry in index.manifest.tables}
        whole = all(sha256(tables[entry.path]) == entry.sha256 for entry in index.manifest.tables)
        if whole and before == _bytes(folder, paths.SESSION):
            marks = _bytes(folder, paths.MARKS)
            changing = {paths.SESSION: before, **tables, **({paths.MARKS: marks} if marks else {})}
            rest = [entry.path for entry in index.files() if entry.path not in changing]
            return [*changing.items(), *((path, _there(folder, path)) for path in rest)]
        time.sleep(_PAUSE_S)
    raise ConflictError(
        "session-unsettled",
        f"{folder.name} changes, or its tables are not those that session.json knows",
        "ask again once no capture runs; verify tells whether it is whole",
    )


def _bytes(folder: Path, path: str) -> bytes:
    try:
        return (folder / path).read_bytes()
    except FileNotFoundError:
        return b""


def _there(folder: Path, path: str) -> Path:
    place = folder / path
    if place.is_symlink() or not place.is_file():
        raise InputError("session-damaged", f"{place} is missing", "restore it from a copy")
    return place
