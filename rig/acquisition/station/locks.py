"""One owner per device: a second process is refused, and told who holds it.

A lock file lies in one folder for all users of the computer, named after its device.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

from common.closing import Closing
from common.errors import ConflictError, InputError
from common.files.lock import KernelLock, LockHeldError, lock_file
from common.words import as_text
from rig.acquisition.cameras.folder import FolderBackend
from rig.acquisition.cameras.folderoptions import FolderOptions, owned
from rig.acquisition.cameras.options import read_options
from rig.acquisition.station.spec import CameraPlan, Station

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
        _camera_name(station, camera)
        for camera in station.cameras
        if camera.backend not in UNSHARED_BACKENDS
    ]
    return list(dict.fromkeys(names))


def _camera_name(station: Station, camera: CameraPlan) -> str:
    if camera.backend == FolderBackend.name:
        # Whatever a folder is called here, no other station may take its files meanwhile.
        options = station.backend_options.get(camera.backend, {})
        return owned(read_options(camera.backend, FolderOptions, options), camera.id)
    return f"{camera.backend} camera {camera.id}"


def _real(url: str) -> str:
    """The device behind a stable link, so that two names of one port are one lock."""
    return os.path.realpath(url) if url.startswith("/") else url


class DeviceLocks(Closing):
    """Locks on devices by name, held until :meth:`release`.

    Raises :class:`ConflictError` ``conflict/device-busy`` naming the holder when one is taken;
    then none is held.
    """

    def __init__(self, names: Iterable[str], folder: Path | None = None) -> None:
        self._folder = lock_folder() if folder is None else folder
        self._held: list[KernelLock] = []
        try:
            for name in names:
                self._held.append(self._take(name))
        except BaseException:
            self.close()
            raise

    def _take(self, name: str) -> KernelLock:
        try:
            if not self._folder.is_dir():
                self._folder.mkdir(parents=True, exist_ok=True)
                # Another user's process must be able to lock, and not to remove, files here.
                self._folder.chmod(0o1777)
            return lock_file(self._folder / lock_name(name), _me())
        except LockHeldError as error:
            raise ConflictError(
                "device-busy",
                f"the {name} is in use by {_who(error.holder)}",
                "stop that first, or work through its service",
            ) from None
        except OSError as error:
            raise InputError(
                "locks-unwritable",
                f"cannot lock the {name} in {self._folder} ({(error.strerror or '').lower()})",
                "make that folder writable",
            ) from error

    def close(self) -> None:
        """Let go of all. Closing twice changes nothing."""
        while self._held:
            self._held.pop().release()


def lock_name(name: str) -> str:
    """The lock file of what ``name`` stands for: its end can be read, all of it tells it apart."""
    readable = re.sub(r"[^A-Za-z0-9]+", "-", name)[-60:].strip("-")
    return f"{readable}.{hashlib.sha256(os.fsencode(name)).hexdigest()[:12]}.lock"


def _me() -> str:
    me = {"pid": os.getpid(), "host": platform.node(), "command": as_text(" ".join(sys.argv))[:300]}
    return json.dumps(me, ensure_ascii=False)


def _who(text: str) -> str:
    try:
        holder = json.loads(text)
        return f"process {holder['pid']} on {holder['host']} ({holder['command']})"
    except (ValueError, KeyError, TypeError):
        # The holder has the lock and has not yet written its name.
        return "another process"
