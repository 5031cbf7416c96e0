"""Files written whole or not at all."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from common.errors import ConflictError, InputError

LARGEST_BYTES = 200_000_000


def write_whole(path: Path, data: bytes, overwrite: bool = False, *, private: bool = False) -> None:
    """Writes to a neighbour, then renames; what is replaced keeps its permissions.

    A ``private`` file is at no moment open to anybody but its owner.

    Raises :class:`ConflictError` when the file is there, :class:`InputError` when it cannot be
    written.
    """
    if path.exists() and not overwrite:
        raise ConflictError(
            "file-exists", f"{path.name} exists already", "give another name, or allow overwriting"
        )
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        with open(part, "wb", opener=_private if private else None) as file:
            file.write(data)
            file.flush()
            # Renamed first and written later, a file would be empty after a loss of power.
            os.fsync(file.fileno())
        if path.exists() and not private:
            part.chmod(path.stat().st_mode & 0o7777)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise InputError(
            "file-write",
            f"{path.name} cannot be written ({(error.strerror or 'unwritable').lower()})",
            "make its folder writable, or give another",
        ) from error


def _private(path: str, flags: int) -> int:
    return os.open(path, flags, 0o600)


def read_limited(path: Path) -> bytes:
    """A file's bytes; raises :class:`InputError` when it is missing or far too large."""
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise InputError(
                "file-too-large",
                f"{path.name} has more than {LARGEST_BYTES // 1_000_000} MB",
                "give a file that this program wrote",
            )
        return path.read_bytes()
    except OSError as error:
        raise InputError(
            "file-read", f"{path.name} cannot be read ({error.strerror})", "check the path"
        ) from error
