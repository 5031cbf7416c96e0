"""Writing that a power cut cannot halve: everything a session does to a disk goes through here."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

from common.errors import ConflictError, InputError

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
FORBIDDEN = (errno.EROFS, errno.EACCES, errno.EPERM)
UNNAMEABLE = (errno.ENAMETOOLONG, errno.ENOTDIR, errno.ELOOP)
CHUNK_BYTES = 1 << 20


class Disk:
    """The file operations a session needs, each durable when it returns."""

    def free_bytes(self, folder: Path) -> int:
        """Free space of the file system that holds ``folder``."""
        return shutil.disk_usage(folder).free

    def make_folder(self, folder: Path) -> None:
        """A folder and its parents; one that is there already is fine."""
        if folder.is_dir():
            return
        self.make_folder(folder.parent)
        with contextlib.suppress(FileExistsError):
            folder.mkdir()
        self.sync_folder(folder.parent)

    def write(self, path: Path, data: bytes) -> None:
        """A file of its own name. Not atomic: for places that nobody takes for whole."""
        with path.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())

    def move(self, source: Path, target: Path) -> None:
        """Rename within one file system; durable after :meth:`sync_folder` of both folders."""
        source.replace(target)

    def sync_folder(self, folder: Path) -> None:
        """Make names in a folder durable."""
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)

    def replace(self, path: Path, data: bytes, scratch: Path) -> None:
        """Put a file in place whole, or leave what was there; ``scratch`` is a folder beside."""
        self.make_folder(scratch)
        half = scratch / f"{path.name}.half"
        self.write(half, data)
        self.make_folder(path.parent)
        self.move(half, path)
        self.sync_folder(path.parent)

    def sweep(self, folder: Path, ours: Callable[[str], object]) -> None:
        """Remove the files below a folder that are ``ours`` by their paths in it.

        Folders that are empty then go too, itself included. All else stays, links unfollowed.
        """
        if folder.is_symlink() or not folder.is_dir():
            return
        for path in sorted(folder.rglob("*"), reverse=True):
            if path.is_symlink():
                continue
            if path.is_dir():
                _remove_empty(path)
            elif path.is_file() and ours(path.relative_to(folder).as_posix()):
                path.unlink()
        _remove_empty(folder)
        self.sync_folder(folder.parent)

    def remove(self, folder: Path) -> None:
        """A folder with all that is in it; none is fine."""
        if folder.is_dir():
            shutil.rmtree(folder)
            self.sync_folder(folder.parent)


def _remove_empty(folder: Path) -> None:
    try:
        folder.rmdir()
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST, errno.EBUSY):
            raise


def sha256(data: bytes) -> str:
    """The checksum of some bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def file_sha256(path: Path) -> str:
    """The checksum of a file, read in pieces."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(CHUNK_BYTES):
            digest.update(piece)
    return digest.hexdigest()


def two_disks(folder: Path, elsewhere: Path) -> ConflictError:
    """What a session that lies on two disks is told: nothing can be moved between them at once."""
    where = f"{elsewhere} is on another" if elsewhere != folder else "a folder in it is on another"
    return ConflictError(
        "session-two-disks",
        f"the session {folder} lies on two disks: {where}",
        "move all of it to one disk, and give it there",
    )


@contextlib.contextmanager
def disk_errors(folder: Path) -> Iterator[None]:
    """Give every trouble with the disk a name.

    :class:`ConflictError` ``disk-full``, ``session-two-disks`` and ``disk-error``;
    :class:`InputError` ``session-unwritable``.
    """
    try:
        yield
    except OSError as error:
        reason = (error.strerror or "unknown trouble").lower()
        if error.errno in FULL:
            raise ConflictError(
                "disk-full",
                f"there is no space left for {folder} ({reason})",
                "free some, or choose a session on another disk",
            ) from error
        if error.errno == errno.EXDEV:
            raise two_disks(folder, folder) from error
        if error.errno in UNNAMEABLE:
            raise InputError(
                "session-unwritable",
                f"there can be no folder {folder} ({reason})",
                "choose another folder",
            ) from error
        if error.errno in FORBIDDEN:
            raise InputError(
                "session-unwritable",
                f"cannot write to {folder} ({reason})",
                "make it writable, or choose another folder",
            ) from error
        raise ConflictError(
            "disk-error",
            f"the disk that holds {folder} fails ({reason})",
            "copy the session elsewhere and check the disk",
        ) from error
