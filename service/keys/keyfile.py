"""The file of keys in the data folder: hashes, never the keys themselves."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AwareDatetime, Field

from common.errors import ConflictError, InputError, NotFoundError
from common.files.lock import LockHeldError, lock_folder
from common.files.reading import read_limited
from common.files.strict import StrictModel, parsed
from common.files.writing import write_whole
from service.keys.scope import Scope

FILE_NAME = "keys.json"
SCHEMA = "rigwright.keys/1"
_MARK = "rw_"
"""Begins every key, so that one in a wrong place is seen for what it is."""

_TOKEN_BYTES = 32
_LONGEST_DAYS = 3660


class Key(StrictModel):
    """One key: who has it, what it may do, and until when."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
    scope: Scope
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    created_at: AwareDatetime
    expires_at: AwareDatetime | None

    def valid(self) -> bool:
        """Whether it may still be used."""
        return self.expires_at is None or datetime.now(UTC) < self.expires_at


class _KeyFile(StrictModel):
    schema_: Annotated[Literal["rigwright.keys/1"], Field(alias="schema")]
    keys: list[Key]


def digest(token: str) -> str:
    """What is kept of a key or a sign-in.

    A slow hash makes guessing dear where a person chose the secret. These have 256 random bits,
    which nobody guesses at any speed; and the hash is computed for every request.
    """
    return hashlib.sha256(token.encode()).hexdigest()


def new_token() -> str:
    """256 random bits as text."""
    return _MARK + secrets.token_urlsafe(_TOKEN_BYTES)


def read_keys(folder: Path) -> list[Key]:
    """The keys of a data folder, none where it has no file of keys.

    Raises :class:`InputError` for a file that is not sound.
    """
    path = folder / FILE_NAME
    if not path.exists() and not path.is_symlink():
        return []
    return parsed(_KeyFile, read_limited(path), FILE_NAME).keys


def add_key(folder: Path, name: str, scope: Scope, days: float | None) -> tuple[Key, str]:
    """A new key and its token, which nobody can read again.

    Raises :class:`ConflictError` where the name is taken, :class:`InputError` for a bad name.
    """
    now, token = datetime.now(UTC).replace(microsecond=0), new_token()
    if days is not None and not 0.0 < days <= _LONGEST_DAYS:
        raise InputError(
            "key-days", f"a key cannot be for {days:g} days", f"give 0 to {_LONGEST_DAYS}"
        )
    key = Key(
        name=name,
        scope=scope,
        sha256=digest(token),
        created_at=now,
        expires_at=None if days is None else now + timedelta(days=days),
    )
    with _changing(folder) as keys:
        if any(other.name == name for other in keys):
            raise ConflictError(
                "key-exists",
                f"there is a key {name!r} already",
                "choose another name, or revoke that one first",
            )
        _write(folder, [*keys, key])
    return key, token


def revoke_key(folder: Path, name: str) -> None:
    """Take a key away. Raises :class:`NotFoundError` where there is none of that name."""
    with _changing(folder) as keys:
        kept = [key for key in keys if key.name != name]
        if len(kept) == len(keys):
            raise NotFoundError("key", f"there is no key {name!r}", "see `rigwright keys list`")
        _write(folder, kept)


@contextmanager
def _changing(folder: Path) -> Iterator[list[Key]]:
    """The keys, while nobody else changes them."""
    try:
        lock = lock_folder(folder)
    except FileNotFoundError:
        raise NotFoundError(
            "data-folder", f"there is no folder {folder}", "give the service's with --data"
        ) from None
    except LockHeldError:
        raise ConflictError(
            "keys-busy", "another command is changing the keys", "run it again"
        ) from None
    try:
        yield read_keys(folder)
    finally:
        lock.release()


def _write(folder: Path, keys: Sequence[Key]) -> None:
    document = _KeyFile.model_validate({"schema": SCHEMA, "keys": list(keys)})
    text = document.model_dump_json(by_alias=True, indent=1) + "\n"
    write_whole(folder / FILE_NAME, text.encode(), overwrite=True, private=True)
