"""A disk that fails at a chosen operation, having done half of it."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

from rig.acquisition.session.storage import Disk


class PowerCut(BaseException):
    """Everything stops here: nothing after it may run as if it had not."""


class FaultyDisk(Disk):
    """Counts operations; at number ``fail_at`` (from 0) half of it is done and ``error`` raised.

    ``for_good``: all operations after it fail as well, as they do on a full disk or after a power
    cut. ``delay_s``: how long each write takes.
    """

    def __init__(
        self,
        fail_at: int | None = None,
        error: BaseException | None = None,
        *,
        for_good: bool = True,
        delay_s: float = 0.0,
    ) -> None:
        self.operations = 0
        self.fail_at = fail_at
        self.error = PowerCut() if error is None else error
        self.for_good = for_good
        self.delay_s = delay_s
        self.failed = False
        self._lock = threading.Lock()

    def _fails(self) -> bool:
        with self._lock:
            number = self.operations
            self.operations += 1
        if self.fail_at is None:
            return False
        fails = number >= self.fail_at if self.for_good else number == self.fail_at
        self.failed |= fails
        return fails

    def _refuse(self) -> BaseException:
        error = self.error
        if isinstance(error, OSError):
            return OSError(error.errno, os.strerror(error.errno or 0))
        return type(error)()

    def make_folder(self, folder: Path) -> None:
        if self._fails():
            raise self._refuse()
        super().make_folder(folder)

    def write(self, path: Path, data: bytes) -> None:
        time.sleep(self.delay_s)
        if self._fails():
            path.write_bytes(data[: len(data) // 2])
            raise self._refuse()
        # Without fsync: what is stopped here is the program, and hundreds of captures are taken.
        path.write_bytes(data)

    def move(self, source: Path, target: Path) -> None:
        if self._fails():
            raise self._refuse()
        super().move(source, target)

    def sync_folder(self, folder: Path) -> None:  # noqa: ARG002  as for write
        if self._fails():
            raise self._refuse()

    def sweep(self, folder: Path, ours: Callable[[str], object]) -> None:
        if self._fails():
            inside = sorted(p for p in folder.rglob("*") if p.is_file()) if folder.is_dir() else []
            for path in inside[: len(inside) // 2]:
                if ours(path.relative_to(folder).as_posix()):
                    path.unlink()
            raise self._refuse()
        super().sweep(folder, ours)

    def remove(self, folder: Path) -> None:
        if self._fails():
            inside = sorted(p for p in folder.rglob("*") if p.is_file()) if folder.is_dir() else []
            for path in inside[: len(inside) // 2]:
                path.unlink()
            raise self._refuse()
        super().remove(folder)
