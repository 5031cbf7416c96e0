"""Files written whole or not at all, and never over what is somebody else's."""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from common.errors import ConflictError, InputError

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_UNFINISHED = re.compile(r"\.rigwright-[0-9a-f]{16}")
_NO_LINKS = (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK)


def write_whole(path: Path, data: bytes, overwrite: bool = False, *, private: bool = False) -> None:
    """Writes to a neighbour, then renames; what is replaced keeps owner, permissions, attributes.

    A link stays, and the file it leads to is replaced. Another hard link to it keeps what was in
    it, as those who keep copies by such links want. Without ``overwrite`` nothing is replaced,
    what appears meanwhile included, and with it nothing that is write-protected. A ``private``
    file is at no moment open to anybody but its owner, who is that of its folder for a new one.

    Raises :class:`ConflictError` when the file is there, :class:`InputError` when it cannot be
    written.
    """
    place = writable_place(path, overwrite=overwrite)
    try:
        put_whole(place, data, overwrite=overwrite, private=private)
    except FileExistsError:
        raise _taken(path) from None
    except OSError as error:
        raise _unwritable(path, error) from error


def put_whole(place: Path, data: bytes, *, overwrite: bool, private: bool = False) -> None:
    """As :func:`write_whole`, over a :func:`writable_place`; raises :class:`OSError`."""
    part = neighbour(place)
    try:
        with open(part, "wb", opener=_private if private else None) as file:
            file.write(data)
            file.flush()
            # Renamed first and written later, a file would be empty after a loss of power.
            os.fsync(file.fileno())
        _dress(part, place, private=private)
        if overwrite:
            part.replace(place)
        else:
            put_new(part, place)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def _dress(part: Path, place: Path, *, private: bool) -> None:
    """Give ``part`` what the file at ``place`` has, as far as this process may."""
    there = place.exists()
    if there or private:
        give_owner(part, (place if there else place.parent).stat())
    if there and not private:
        written = part.stat()
        # After the owner: a change of owner takes bits away.
        shutil.copystat(place, part)
        os.utime(part, ns=(written.st_atime_ns, written.st_mtime_ns))


def give_owner(path: Path, owned: os.stat_result) -> None:
    """Give ``path`` the group and owner in ``owned``, each as far as this process may.

    Some file systems know no owners, and some owners are not known here.
    """
    with suppress(OSError):
        os.chown(path, -1, owned.st_gid)
    with suppress(OSError):
        os.chown(path, owned.st_uid, -1)


def writable_place(path: Path, *, overwrite: bool) -> Path:
    """Where a file written to ``path`` ends up: ``path`` itself, or where its link leads.

    Raises :class:`ConflictError` where something is there and ``overwrite`` is not asked for,
    :class:`InputError` where that is no plain file, is write-protected, or the link leads to
    nothing.
    """
    if not os.path.lexists(path):
        return path
    if not overwrite:
        raise _taken(path)
    try:
        place = path.resolve(strict=True)
        mode = place.stat().st_mode
    except (OSError, RuntimeError) as error:
        raise InputError(
            "file-write", f"{path} is a link that leads to no file", "mend it or remove it"
        ) from error
    if not stat.S_ISREG(mode):
        raise InputError("file-write", f"{path} is no plain file", "give another name")
    # An administrator may write whatever the permissions say; whoever took them away meant him too.
    if not (mode & stat.S_IWUSR and os.access(place, os.W_OK, effective_ids=True)):
        raise InputError(
            "file-write", f"{path} is write-protected", "make it writable, or give another name"
        )
    return place


def neighbour(place: Path) -> Path:
    """A free name in the folder of ``place``, for a file on its way there; never too long."""
    return place.with_name(f".rigwright-{secrets.token_hex(8)}")


def is_unfinished(path: Path) -> bool:
    """Whether a plain file is one on its way, which only a process that was killed leaves."""
    named = _UNFINISHED.fullmatch(path.name) is not None
    return named and path.is_file() and not path.is_symlink()


def remove_unfinished(folder: Path) -> None:
    """Remove what a killed process left half written; call it where no other can write."""
    for path in folder.glob(".rigwright-*"):
        if is_unfinished(path):
            path.unlink(missing_ok=True)


def put_new(part: Path, place: Path) -> None:
    """Give a whole file its name; raises :class:`FileExistsError` where that is taken by now."""
    try:
        os.link(part, place, follow_symlinks=False)
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        # A file system without hard links: the name is taken first, and only then replaced.
        place.open("xb").close()
        try:
            part.replace(place)
        except OSError:
            place.unlink()
            raise
        return
    part.unlink()


@contextmanager
def with_parents(folder: Path) -> Iterator[None]:
    """``folder`` and those above it are made; what was made goes again when something fails.

    What has been put into them meanwhile stays, and they with it. Raises :class:`OSError`.
    """
    made = missing(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        remove_empty(made)
        raise


def missing(folder: Path) -> list[Path]:
    """``folder`` and those above it that are not there, the innermost first."""
    return [above for above in (folder, *folder.parents) if not os.path.lexists(above)]


def remove_empty(folders: Iterable[Path]) -> None:
    """Remove those of some folders in which nothing is, in this order."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def _private(path: str, flags: int) -> int:
    return os.open(path, flags, 0o600)


def _taken(path: Path) -> ConflictError:
    return ConflictError(
        "file-exists", f"{path.name} exists already", "give another name, or allow overwriting"
    )


def _unwritable(path: Path, error: OSError) -> InputError:
    remedy = "make its folder writable, or give another"
    if error.errno in FULL:
        remedy = "free some space, or give another folder"
    if error.errno == errno.ENAMETOOLONG:
        remedy = "give a shorter name"
    if error.errno in (errno.ENOENT, errno.ENOTDIR):
        remedy = "give a name in a folder that is there"
    why = (error.strerror or "unwritable").lower()
    return InputError("file-write", f"{path.name} cannot be written ({why})", remedy)
