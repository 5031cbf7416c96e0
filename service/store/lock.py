"""One service per data folder."""

from __future__ import annotations

import os
from pathlib import Path

from common.errors import ConflictError
from common.files.lock import LockHeldError, lock_file


class FolderLock:
    """Holds a folder for this process. The system lets go of it when the process dies."""

    def __init__(self, folder: Path) -> None:
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
