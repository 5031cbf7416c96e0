"""One service per data folder."""

from __future__ import annotations

import os
import re
from pathlib import Path

from common.errors import ConflictError, InputError
from common.files.lock import LockHeldError, lock_file

_LARGEST_BYTES = 20


class FolderLock:
    """Holds a folder for this process. The system lets go of it when the process dies."""

    def __init__(self, folder: Path) -> None:
        _refuse_foreign(folder / "lock")
        try:
            self._lock = lock_file(folder / "lock", str(os.getpid()))
        except LockHeldError as error:
            raise ConflictError(
                "data-folder-in-use",
                f"another service (process {error.holder or 'unknown'}) uses the data folder "
                f"{folder}",
                "stop it, or give this one another folder with --data",
            ) from error

    def release(self) -> None:
        """Let another service use the folder."""
        self._lock.release()


def _refuse_foreign(path: Path) -> None:
    """A lock of ours holds nothing but the number of a process."""
    if not os.path.lexists(path):
        return
    plain = path.is_file() and not path.is_symlink() and path.stat().st_size <= _LARGEST_BYTES
    if not plain or not re.fullmatch(rb"\d*", path.read_bytes()):
        raise InputError(
            "data-folder",
            f"the file {path} is not of this program",
            "move it away, or give another folder with --data",
        )
