"""One service per data folder."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from common.errors import ConflictError


class FolderLock:
    """Holds a folder for this process. The system lets go of it when the process dies."""

    def __init__(self, folder: Path) -> None:
        path = folder / "lock"
        self._file = path.open("a+")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._file.seek(0)
            holder = self._file.read().strip() or "unknown"
            self._file.close()
            raise ConflictError(
                "data-folder-in-use",
                f"another service (process {holder}) uses the data folder {folder}",
                "stop it, or give this one another folder with --data",
            ) from error
        self._file.truncate(0)
        self._file.write(str(os.getpid()))
        self._file.flush()

    def release(self) -> None:
        """Let another service use the folder."""
        self._file.close()
