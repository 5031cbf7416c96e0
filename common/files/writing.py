"""Files written whole or not at all."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from common.errors import ConflictError, InputError

LARGEST_BYTES = 200_000_000


def write_whole(path: Path, data: bytes, overwrite: bool = False) -> None:
    """Writes to a neighbour, then renames. Raises :class:`ConflictError` when the file is there."""
    if path.exists() and not overwrite:
        raise ConflictError(
            "file-exists", f"{path.name} exists already", "give another name, or allow overwriting"
        )
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        part.write_bytes(data)
        os.replace(part, path)  # noqa: PTH105 - one system call, and the name says what it does
    except OSError as error:
        part.unlink(missing_ok=True)
        raise InputError(
            "file-write", f"{path.name} cannot be written ({error.strerror})", "give another folder"
        ) from error


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
