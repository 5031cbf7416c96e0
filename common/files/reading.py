"""Files that were given: read with a limit, and without waiting for what never ends."""

from __future__ import annotations

import errno
import json
import os
import stat
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from common.errors import InputError, TooLargeError

LARGEST_BYTES = 200_000_000
BYTE_ORDER_MARK = "\ufeff"


def plain_size(path: Path) -> int:
    """The bytes of a plain file.

    Raises :class:`OSError`, for a folder, a pipe and a device too: reading a pipe would wait for
    somebody to write into it, and some devices never end.
    """
    found = path.stat()
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "no plain file", str(path))
    return found.st_size


def plain_bytes(path: Path) -> bytes:
    """The content of a plain file; raises :class:`OSError` as :func:`plain_size` does."""
    plain_size(path)
    return path.read_bytes()


def json_data(text: str | bytes) -> Any:  # noqa: ANN401 - as json.loads
    """What a JSON text says; raises :class:`ValueError` for whatever keeps it from being read."""
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def json_in(path: Path) -> Any:  # noqa: ANN401 - as json.loads
    """What a plain file of JSON says; raises :class:`OSError` and :class:`ValueError`."""
    return json_data(plain_bytes(path).decode("utf-8-sig"))


def read_json(path: Path, kind: str, words: str, largest_bytes: int) -> Any:  # noqa: ANN401
    """The JSON data in a file; ``kind`` stands in error codes, ``words`` says what it is.

    Raises :class:`InputError` ``<kind>-unreadable`` and ``<kind>-not-json``,
    :class:`TooLargeError` ``<kind>-too-large``.
    """
    remedy = f"give a {kind}.json"
    with readable(path, kind, words, remedy, largest_bytes):
        try:
            return json_in(path)
        except ValueError as error:
            raise InputError(f"{kind}-not-json", f"{path.name} is not JSON", remedy) from error


@contextmanager
def readable(path: Path, kind: str, words: str, remedy: str, largest_bytes: int) -> Generator[None]:
    """Refuse a file that is too large or no plain one, and say why one cannot be read.

    Raises :class:`InputError` ``<kind>-unreadable``, :class:`TooLargeError` ``<kind>-too-large``.
    """
    try:
        if plain_size(path) > largest_bytes:
            problem = f"{path.name} is too large for a {words}"
            raise TooLargeError(f"{kind}-too-large", problem, remedy)
        yield
    except OSError as error:
        reason = (error.strerror or "unreadable").lower()
        raise InputError(
            f"{kind}-unreadable", f"cannot read the {words} {path} ({reason})", "check the path"
        ) from error


def read_limited(path: Path) -> bytes:
    """A file's bytes; raises :class:`InputError` when it is missing or far too large."""
    try:
        if plain_size(path) > LARGEST_BYTES:
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
