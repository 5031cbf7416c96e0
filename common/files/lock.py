"""The kernel's locks on files and folders (``flock``): a process that dies lets go of them.

What is written into a lock file is for people only.
"""

from __future__ import annotations

import fcntl
import os
from contextlib import suppress
from pathlib import Path

_LARGEST_NOTE_BYTES = 4096


class LockHeldError(Exception):
    """Another process has the lock; ``holder`` is what it wrote into the file."""

    def __init__(self, holder: str) -> None:
        super().__init__(holder)
        self.holder = holder


class KernelLock:
    """A lock that is held until :meth:`release`. Releasing twice changes nothing."""

    def __init__(self, handle: int) -> None:
        self._handle: int | None = handle

    def release(self) -> None:
        """Let go. A lock file stays: removing it could take it from under a new holder."""
        handle, self._handle = self._handle, None
        if handle is not None:
            os.close(handle)


def lock_folder(folder: Path) -> KernelLock:
    """A lock on a folder itself, which stays with it when it is renamed.

    Raises :class:`LockHeldError`, and :class:`OSError` where there is no such folder.
    """
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    return _locked(handle)


def lock_file(path: Path, note: str) -> KernelLock:
    """A lock on a file that is made where it is not there; ``note`` says who holds it.

    Any user of the computer can lock it too. Raises :class:`LockHeldError`, and :class:`OSError`
    where the file cannot be opened.
    """
    handle = _opened(path)
    lock = _locked(handle)
    os.ftruncate(handle, 0)
    os.pwrite(handle, os.fsencode(note)[:_LARGEST_NOTE_BYTES], 0)
    return lock


def held_note(path: Path) -> tuple[str, int] | None:
    """What the holder of a lock file wrote into it, and whose file it is (user id).

    None where nobody holds it. Holds it itself for a moment, shared with others who look. Raises
    :class:`OSError` where it cannot be read.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except FileNotFoundError:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return _note(handle), os.fstat(handle).st_uid
    else:
        return None
    finally:
        os.close(handle)


def _opened(path: Path) -> int:
    # A planted link must not make this process write into somebody's file.
    flags = os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW
    while True:
        # Linux refuses O_CREAT on another user's file in a folder like /tmp, so what is there is
        # opened without it.
        with suppress(FileNotFoundError):
            return os.open(path, flags)
        with suppress(FileExistsError):
            handle = os.open(path, flags | os.O_CREAT | os.O_EXCL, 0o666)
            # Whatever the umask says, another user's process must be able to lock it.
            os.fchmod(handle, 0o666)
            return handle


def _locked(handle: int) -> KernelLock:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = _note(handle)
        os.close(handle)
        raise LockHeldError(holder) from None
    except BaseException:
        os.close(handle)
        raise
    return KernelLock(handle)


def _note(handle: int) -> str:
    # A folder cannot be read; a holder may not yet have written its name.
    with suppress(OSError):
        return os.pread(handle, _LARGEST_NOTE_BYTES, 0).decode(errors="replace").strip()
    return ""
