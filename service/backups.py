"""The data folder in one file, and back: a backup is of one moment, while the service runs on."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import sqlite3
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AwareDatetime, Field

from common.errors import ConflictError, InputError, RigwrightError
from common.files.lock import LockHeldError, lock_folder
from common.files.strict import StrictModel, parsed
from common.files.writing import neighbour, put_new, with_parents
from common.version import program_version
from service.keys import audit, keyfile
from service.stations import removed
from service.stations.filed import filed_at_once
from service.stations.registry import STATION_KINDS
from service.store import DATABASE_NAME, Store
from service.store.blobs import known_files

SCHEMA = "rigwright.backup/1"
_ABOUT = "backup.json"
_PART = ".restore-"
_TRIES = 3
_CHUNK_BYTES = 1 << 20
_BLOB = re.compile(r"blobs/sha256/([0-9a-f]{2})/([0-9a-f]{2})/(\1\2[0-9a-f]{60})")
_NAME = r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}"
_NAMES = (
    _BLOB,
    re.compile(rf"{re.escape(DATABASE_NAME)}|{re.escape(keyfile.FILE_NAME)}|{_ABOUT}"),
    re.compile(rf"{re.escape(audit.FILE_NAME)}(\.\d)?"),
    re.compile(
        rf"sessions/({re.escape(removed.FOLDER)}/{_NAME}~\d{{8}}T\d{{12}}Z|{_NAME})"
        r"(/(?!\.{1,2}(/|$))[^/\\\0]+)+"
    ),
)
"""All that may be in a backup: nothing else is written anywhere."""


class About(StrictModel):
    """What a backup says of itself."""

    schema_: Annotated[Literal["rigwright.backup/1"], Field(alias="schema")]
    program: str
    made_at: AwareDatetime


@dataclass(frozen=True)
class Backup:
    """What was put into a backup, or taken out of it. ``damaged``: sessions that are not whole.

    ``removed``: sessions besides that were deleted and can still be brought back.
    """

    blobs: int
    sessions: int
    size_bytes: int
    damaged: tuple[str, ...] = ()
    removed: int = 0


def back_up(data: Path, sessions: Path, out: Path) -> Backup:
    """Write the data folder and all sessions to the ZIP file ``out``; a service may run meanwhile.

    Raises :class:`ConflictError` where ``out`` exists, :class:`InputError` where there is no data
    or nothing can be written.
    """
    if not (data / DATABASE_NAME).is_file():
        raise InputError(
            "no-data", f"the folder {data} has no data of a service", "give its --data"
        )
    if os.path.lexists(out):
        raise _there_already(out)
    part = neighbour(out)
    try:
        for attempt in range(_TRIES):
            try:
                made = _written(data, sessions, part)
                break
            except FileNotFoundError:
                # Something was removed between the look at the database and its file.
                part.unlink(missing_ok=True)
                if attempt == _TRIES - 1:
                    raise
        put_new(part, out)
    except FileExistsError as error:
        raise _there_already(out) from error
    except OSError as error:
        raise InputError(
            "backup-write", f"{out} cannot be written ({error})", "make room, or give another place"
        ) from error
    except sqlite3.DatabaseError as error:
        raise InputError(
            "no-data", f"the database in {data} cannot be read ({error})", "give a service's --data"
        ) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
    return made


def _there_already(out: Path) -> ConflictError:
    return ConflictError("backup-exists", f"{out} is there already", "give another name")


def _written(data: Path, sessions: Path, part: Path) -> Backup:
    damaged = []
    with (
        tempfile.TemporaryDirectory() as scratch,
        # Subjects' pictures and the hashes of keys are in it.
        open(part, "xb", opener=lambda path, flags: os.open(path, flags, 0o600)) as file,
        zipfile.ZipFile(file, "w") as archive,
    ):
        about = {"schema": SCHEMA, "program": program_version(), "made_at": datetime.now(UTC)}
        archive.writestr(_ABOUT, About.model_validate(about).model_dump_json(by_alias=True))
        copy = Path(scratch) / DATABASE_NAME
        hashes = _copied(data / DATABASE_NAME, copy)
        archive.write(copy, DATABASE_NAME, zipfile.ZIP_DEFLATED)
        for sha256 in hashes:
            name = f"blobs/sha256/{sha256[:2]}/{sha256[2:4]}/{sha256}"
            archive.write(data / name, name)
        for path in [data / keyfile.FILE_NAME, *sorted(data.glob(f"{audit.FILE_NAME}*"))]:
            if path.is_file():
                archive.write(path, path.name, zipfile.ZIP_DEFLATED)
        folders, away = _sessions(sessions), _sessions(sessions / removed.FOLDER)
        for folder in [*folders, *away]:
            try:
                files = filed_at_once(folder)
            except RigwrightError:
                # Half a session is better than none; verify tells what it lacks.
                damaged.append(folder.name)
                files = [(_relative(p, folder), p) for p in folder.rglob("*") if p.is_file()]
            for inner, content in files:
                name = f"sessions/{_relative(folder, sessions)}/{inner}"
                if isinstance(content, bytes):
                    archive.writestr(name, content)
                else:
                    archive.write(content, name)
    # Renamed first and written later, a backup would be empty after a loss of power.
    with part.open("rb") as written:
        os.fsync(written.fileno())
    return Backup(len(hashes), len(folders), part.stat().st_size, tuple(damaged), len(away))


def _relative(path: Path, folder: Path) -> str:
    return path.relative_to(folder).as_posix()


def _sessions(root: Path) -> list[Path]:
    return sorted(path.parent for path in root.glob("*/session.json"))


def _copied(database: Path, copy: Path) -> list[str]:
    """Copy a database of one moment; the hashes of the files that it knows."""
    with closing(sqlite3.connect(database)) as live, closing(sqlite3.connect(copy)) as kept:
        live.backup(kept)
        return [row[0] for row in kept.execute("SELECT sha256 FROM blobs ORDER BY sha256")]


def restore(backup: Path, data: Path) -> Backup:
    """Write a backup to the empty folder ``data`` and bring it up to date; all of it is checked.

    Until then all of it is in a folder of its own within ``data``, so that nothing of anybody's
    is ever in the way of a failure. Raises :class:`ConflictError` where ``data`` holds something,
    or another restore works there, :class:`InputError` where the backup is not sound; then
    nothing is left.
    """
    with _opened(backup) as archive, _claimed(data), _partial(data) as part:
        names = [name for name in archive.namelist() if not name.endswith("/")]
        for name in names:
            if not any(form.fullmatch(name) for form in _NAMES):
                raise _unsound(backup, f"holds {name!r}")
        parsed(About, archive.read(_ABOUT), f"{backup.name}: {_ABOUT}")
        for name in names:
            _extract(archive, name, part, backup)
        with Store(part, settled_elsewhere=STATION_KINDS) as store:
            known = store.database.read(known_files)
            missing = [sha256 for sha256 in known if not store.files.path(sha256).is_file()]
        if missing:
            raise _unsound(backup, f"lacks {len(missing)} of its files")
        size = sum(archive.getinfo(name).file_size for name in names)
        found, away = (_sessions(part / "sessions" / inner) for inner in ("", removed.FOLDER))
        restored = Backup(len(known), len(found), size, removed=len(away))
        _put_in_place(part, data)
        return restored


@contextmanager
def _claimed(data: Path) -> Iterator[None]:
    """An empty folder that no other restore works in; nothing new is left after a failure."""
    if os.path.lexists(data) and not data.is_dir():
        raise InputError("restore-failed", f"{data} is no folder", "give a new one with --data")
    with with_parents(data):
        try:
            lock = lock_folder(data)
        except LockHeldError:
            raise ConflictError(
                "restore-not-empty", f"another command works in {data}", "wait for it to end"
            ) from None
        try:
            _require_empty(data)
            yield
        finally:
            lock.release()


def _require_empty(data: Path) -> None:
    held = sorted(path.name for path in data.iterdir() if path.name != "lost+found")
    if not held:
        return
    remedy = "give a new one with --data"
    parts = [name for name in held if re.fullmatch(rf"{re.escape(_PART)}\w+", name)]
    if parts:
        rest = "" if len(parts) == len(held) else ", and the rest if nothing in it is yours"
        remedy = f"a restore was stopped and left {parts[0]} there: remove that{rest}, or {remedy}"
    raise ConflictError("restore-not-empty", f"the folder {data} is not empty", remedy)


@contextmanager
def _partial(data: Path) -> Iterator[Path]:
    part = Path(tempfile.mkdtemp(prefix=_PART, dir=data))
    try:
        yield part
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _put_in_place(part: Path, data: Path) -> None:
    """Move all up into ``data``, or nothing."""
    # The database last: before there is one no service takes the folder for its own.
    names = sorted((p.name for p in part.iterdir()), key=lambda name: name == DATABASE_NAME)
    moved: list[str] = []
    try:
        for name in names:
            if os.path.lexists(data / name):
                raise ConflictError(
                    "restore-not-empty",
                    f"{data / name} appeared while the backup was restored",
                    "move it away, or give a new folder with --data",
                )
            (part / name).rename(data / name)
            moved.append(name)
    except BaseException:
        for name in moved:
            (data / name).rename(part / name)
        raise


@contextmanager
def _opened(backup: Path) -> Iterator[zipfile.ZipFile]:
    try:
        if backup.exists() and not backup.is_file():
            # Reading a pipe would wait for somebody to write into it.
            raise _unsound(backup, "is no file")
        with zipfile.ZipFile(backup) as archive:
            if not {_ABOUT, DATABASE_NAME} <= set(archive.namelist()):
                raise _unsound(backup, "is no backup of this program")
            yield archive
    except OSError as error:
        raise InputError(
            "restore-failed", f"{backup} cannot be restored ({error})", "check path and disk"
        ) from error
    except (zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise _unsound(backup, f"is damaged ({error})") from error


def _extract(archive: zipfile.ZipFile, name: str, data: Path, backup: Path) -> None:
    if name == _ABOUT:
        return
    place, digest = data / name, hashlib.sha256()
    place.parent.mkdir(parents=True, exist_ok=True)
    private = 0o600 if name.startswith((keyfile.FILE_NAME, audit.FILE_NAME)) else 0o666
    with (
        archive.open(name) as packed,
        open(place, "xb", opener=lambda path, flags: os.open(path, flags, private)) as file,
    ):
        while chunk := packed.read(_CHUNK_BYTES):
            digest.update(chunk)
            file.write(chunk)
        file.flush()
        os.fsync(file.fileno())
    blob = _BLOB.fullmatch(name)
    if blob and blob[3] != digest.hexdigest():
        raise _unsound(backup, f"is damaged ({name} has other content)")


def _unsound(backup: Path, why: str) -> InputError:
    return InputError("backup-damaged", f"{backup} {why}", "give another backup")
