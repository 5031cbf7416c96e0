"""Whether a folder is the data of a service: looked at without changing anything in it."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from pathlib import Path

from common.errors import InputError
from common.files.writing import is_unfinished

DATABASE_NAME = "rigwright.sqlite3"
_BEFORE_THE_DATABASE = {"lock", "lost+found", "keys.json"}
"""A start that was cut short left a lock; a disk of its own has a folder for what is found; keys
are made before a service starts that others can reach."""

_BESIDE_IT = {f"{DATABASE_NAME}{suffix}" for suffix in ("", "-wal", "-shm", "-journal")}
_OUR_TABLES = {"alembic_version", "identity", "blobs", "scans", "jobs", "job_events"}
"""Those of the first version: every later one has them too."""

_FIRST_BYTES = b"SQLite format 3\0"


def refuse_foreign(folder: Path) -> None:
    """Keep away from folders with anybody's files: a start removes what a crash has left.

    Raises :class:`InputError` where ``folder`` holds any and no database of this program.
    """
    held = (path for path in folder.iterdir() if not is_unfinished(path))
    names = {path.name for path in held} - _BEFORE_THE_DATABASE
    found = _tables_in(folder / DATABASE_NAME)
    if found >= _OUR_TABLES:
        return
    if found:
        raise InputError(
            "data-folder",
            f"the database {DATABASE_NAME} in {folder} is not of this program",
            "give a new folder with --data",
        )
    # A first start that was cut short may have made the database, and nothing in it.
    others = names - _BESIDE_IT
    if others:
        raise InputError(
            "data-folder",
            f"the folder {folder} holds other files ({min(others)}), and no data of this program",
            "give a new folder with --data",
        )


def _tables_in(database: Path) -> set[str]:
    """The names of its tables; none where there is no database, or an empty one."""
    if not os.path.lexists(database):
        return set()
    if not database.is_file():
        raise InputError(
            "data-folder", f"{database} is no file", "move it away, or give another folder"
        )
    if database.stat().st_size == 0:
        return set()
    database = database.resolve()
    with database.open("rb") as file:
        if file.read(len(_FIRST_BYTES)) != _FIRST_BYTES:
            raise _damaged(database.parent)
    # What is only in the log of changes shows in a connection that may read it; where there is
    # none, not even the files beside the database are made.
    live = database.with_name(f"{database.name}-wal").exists()
    address = f"{database.as_uri()}?{'mode=ro' if live else 'immutable=1'}"
    try:
        with closing(sqlite3.connect(address, uri=True)) as connection:
            asked = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
            return {str(row[0]) for row in asked}
    except sqlite3.DatabaseError as error:
        raise _damaged(database.parent) from error


def _damaged(folder: Path) -> InputError:
    return InputError(
        "data-folder",
        f"the database in {folder} is damaged or of a newer version of this program",
        "use the newer version, or another folder with --data",
    )
