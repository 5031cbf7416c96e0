"""Files by the hash of their content: ``blobs/sha256/ab/cd/<hash>``.

A file is first written under ``tmp/``, made durable, and only then given its final name, so a
name under ``blobs/`` always stands for a whole file. Names are given and taken on the
database's writer thread only: otherwise a delete could remove a file that an upload of the same
content has just found in place.
"""

from __future__ import annotations

import hashlib
import os
import re
import secrets
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import Connection, and_, delete, exists, select
from sqlalchemy.dialects.sqlite import insert

from common.closing import Closing
from service.store.tables import blobs, documents, job_files, job_inputs, scans, utc_now

_CHUNK_BYTES = 1 << 20
_STAGED = re.compile(r"[0-9a-f]{32}(\.\w+)*")
_HASH = re.compile(r"[0-9a-f]{64}")
_REFERRING = (scans, documents, job_inputs, job_files)


@dataclass(frozen=True)
class StagedFile:
    """A whole, durable file that has no name yet."""

    path: Path
    sha256: str
    size_bytes: int


class Staging(Closing):
    """A file being written. Used as a context manager: what was not adopted is removed."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._hash = hashlib.sha256()
        self._size = 0
        self._file = path.open("xb")

    def write(self, chunk: bytes) -> None:
        """Append ``chunk``."""
        self._file.write(chunk)
        self._hash.update(chunk)
        self._size += len(chunk)

    def finish(self) -> StagedFile:
        """Make what was written durable."""
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()
        return StagedFile(self.path, self._hash.hexdigest(), self._size)

    def close(self) -> None:
        """Let go of it, and of what nobody took over. Closing twice changes nothing."""
        self._file.close()
        self.path.unlink(missing_ok=True)


class Blobs:
    """The folder of files beside the database."""

    def __init__(self, folder: Path) -> None:
        self._root = folder / "blobs" / "sha256"
        self._staging = folder / "tmp"
        for path in (self._root, self._staging):
            path.mkdir(parents=True, exist_ok=True)

    def path(self, sha256: str) -> Path:
        """Where the file with this hash is kept."""
        return self._root / sha256[:2] / sha256[2:4] / sha256

    def stage(self, suffix: str = "") -> Staging:
        """Begin a file; ``suffix`` (such as ``.glb``) tells readers of it what it holds."""
        return Staging(self._staging / f"{secrets.token_hex(16)}{suffix}")

    def stage_existing(self, path: Path) -> StagedFile:
        """Take in a file that lies on the same file system, without a copy."""
        digest, size = hashlib.sha256(), 0
        with path.open("rb+") as file:
            while chunk := file.read(_CHUNK_BYTES):
                digest.update(chunk)
                size += len(chunk)
            os.fsync(file.fileno())
        return StagedFile(path, digest.hexdigest(), size)

    def adopt(self, connection: Connection, staged: StagedFile) -> None:
        """Give a staged file its name and its row. Only inside a write."""
        final = self.path(staged.sha256)
        if not final.exists():
            final.parent.mkdir(parents=True, exist_ok=True)
            staged.path.replace(final)
            _sync_folder(final.parent)
        connection.execute(
            insert(blobs)
            .values(sha256=staged.sha256, size_bytes=staged.size_bytes, created_at=utc_now())
            .on_conflict_do_nothing()
        )

    def forget_unused(self, connection: Connection) -> list[str]:
        """Remove the rows of files that nothing refers to; give the list to :meth:`remove`."""
        unused = and_(
            *(~exists().where(table.c.blob_sha256 == blobs.c.sha256) for table in _REFERRING)
        )
        hashes = list(connection.scalars(select(blobs.c.sha256).where(unused)))
        connection.execute(delete(blobs).where(unused))
        return hashes

    def remove(self, hashes: list[str]) -> None:
        """Remove files whose rows are durably gone. Only after a write."""
        for sha256 in hashes:
            self.path(sha256).unlink(missing_ok=True)

    def sweep(self, known: set[str]) -> list[Path]:
        """Remove what a crash has left: unfinished files, and files without a row.

        Only under names that this class gives, and never through a link. Returns what else is
        there: it is somebody's.
        """
        kept = []
        for path in _entries(self._staging):
            if _STAGED.fullmatch(path.name) and _plain(path):
                path.unlink()
            else:
                kept.append(path)
        for path in self._files():
            if not _ours(path) or not _plain(path):
                kept.append(path)
            elif path.name not in known:
                path.unlink()
        return kept

    def _files(self) -> Iterator[Path]:
        if self._root.parent.is_symlink():
            return
        for outer in _entries(self._root):
            for inner in _entries(outer):
                yield from _entries(inner)


def _entries(folder: Path) -> list[Path]:
    """What is in a folder; nothing where that is none, or a link to one."""
    return list(folder.iterdir()) if folder.is_dir() and not folder.is_symlink() else []


def _plain(path: Path) -> bool:
    return path.is_file() and not path.is_symlink()


def _ours(path: Path) -> bool:
    """Whether a file lies where :meth:`Blobs.path` puts it."""
    name, folders = path.name, (path.parent.parent.name, path.parent.name)
    return _HASH.fullmatch(name) is not None and folders == (name[:2], name[2:4])


def known_files(connection: Connection) -> set[str]:
    """The hashes of all files that have a row."""
    return set(connection.scalars(select(blobs.c.sha256)))


def _sync_folder(folder: Path) -> None:
    # Without this the new name, unlike the content, may be lost with the power.
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
