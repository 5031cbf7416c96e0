"""One owner per device: a second process is refused, and told who holds it.

The locks are the kernel's (``flock``), so a process that dies lets go whatever it died of. What
is written in a lock file is for people only.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import platform
import re
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Self

from common.errors import ConflictError, InputError
from rig.acquisition.station.spec import Station

UNSHARED_BACKENDS = frozenset({"simulated"})
"""Cameras that exist only inside one process: nobody can take them away from another."""

PRIVATE_BOXES = ("fake:", "loop:")
"""Boxes that exist only inside one process."""


def lock_folder() -> Path:
    """Where lock files lie: one place for all users of this computer."""
    return Path(tempfile.gettempdir()) / "rigwright-locks"


def device_names(station: Station) -> list[str]:
    """What has to be owned to work with a station, in words that name it."""
    names = []
    if station.path is not None:
        names.append(f"station {station.path.resolve()}")
    if station.trigger is not None and not station.trigger.url.startswith(PRIVATE_BOXES):
        names.append(f"trigger box {_real(station.trigger.url)}")
    names += [
        f"{camera.backend} camera {camera.id}"
        for camera in station.cameras
        if camera.backend not in UNSHARED_BACKENDS
    ]
    return names


def _real(url: str) -> str:
    """The device behind a stable link, so that two names of one port are one lock."""
    return os.path.realpath(url) if url.startswith("/") else url


class DeviceLocks:
    """Locks on devices by name, held until :meth:`release`.

    Raises :class:`ConflictError` ``conflict/device-busy`` naming the holder when one is taken;
    then none is held.
    """

    def __init__(self, names: Iterable[str], folder: Path | None = None) -> None:
        self._folder = lock_folder() if folder is None else folder
        self._held: list[int] = []
        try:
            for name in names:
                self._held.append(self._take(name))
        except BaseException:
            self.release()
            raise

    def _take(self, name: str) -> int:
        handle = self._open(name)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            holder = os.pread(handle, 4096, 0)
            os.close(handle)
            raise ConflictError(
                "device-busy",
                f"the {name} is in use by {_who(holder)}",
                "stop that first, or work through its service",
            ) from None
        os.ftruncate(handle, 0)
        os.pwrite(handle, json.dumps(_me(), ensure_ascii=False).encode(), 0)
        return handle

    def _open(self, name: str) -> int:
        try:
            if not self._folder.is_dir():
                self._folder.mkdir(parents=True, exist_ok=True)
                # Another user's process must be able to lock, and not to remove, files here.
                self._folder.chmod(0o1777)
            # A planted link must not make this process write into somebody's file.
            flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
            handle = os.open(self._folder / _file_name(name), flags, 0o666)
            if os.fstat(handle).st_uid == os.getuid():
                os.fchmod(handle, 0o666)
        except OSError as error:
            raise InputError(
                "locks-unwritable",
                f"cannot lock the {name} in {self._folder} ({(error.strerror or '').lower()})",
                "make that folder writable",
            ) from error
        return handle

    def release(self) -> None:
        """Let go of all. The files stay: removing one could take it from under a new holder."""
        while self._held:
            os.close(self._held.pop())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.release()


def _file_name(name: str) -> str:
    readable = re.sub(r"[^A-Za-z0-9]+", "-", name)[-60:].strip("-")
    return f"{readable}.{hashlib.sha256(name.encode()).hexdigest()[:12]}.lock"


def _me() -> dict[str, object]:
    return {"pid": os.getpid(), "host": platform.node(), "command": " ".join(sys.argv)[:300]}


def _who(text: bytes) -> str:
    try:
        holder = json.loads(text)
        return f"process {holder['pid']} on {holder['host']} ({holder['command']})"
    except (ValueError, KeyError, TypeError):
        # The holder has the lock and has not yet written its name.
        return "another process"
