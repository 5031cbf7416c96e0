"""The one store of the service: records in SQLite, files by content hash beside it."""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Collection
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.util import CommandError
from sqlalchemy import Connection, insert, select
from sqlalchemy.exc import DatabaseError

from common.closing import Closing
from common.errors import InputError, InternalError
from service.ipc import error_fields
from service.store import idempotency
from service.store.blobs import Blobs, known_files
from service.store.database import Database
from service.store.documents import Documents
from service.store.jobs import Jobs
from service.store.lock import FolderLock
from service.store.scans import Scans
from service.store.signins import SignIns
from service.store.tables import identity, utc_now

DATABASE_NAME = "rigwright.sqlite3"
_BEFORE_THE_DATABASE = {"lock", "lost+found", "keys.json"}
"""A start that was cut short left a lock; a disk of its own has a folder for what is found; keys
are made before a service starts that others can reach."""


def interrupted() -> InternalError:
    """Why a job ended that ran when the service stopped."""
    return InternalError(
        "service-stopped", "the service stopped while the job ran", "ask for the job again"
    )


class Store(Closing):
    """A folder with everything the service must not forget.

    Opening it takes the folder's lock, brings the schema up to date and puts right what a crash
    has left. Raises :class:`~common.errors.ConflictError` when another service has it open,
    :class:`InputError` when the folder cannot be used. Jobs of the kinds in ``settled_elsewhere``
    that ran at a crash are left as they are.
    """

    def __init__(self, folder: Path, *, settled_elsewhere: Collection[str] = ()) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            refuse_foreign(folder)
            self._lock = FolderLock(folder)
        except OSError as error:
            raise InputError(
                "data-folder",
                f"the data folder {folder} cannot be used ({error.strerror})",
                "give a folder you may write to with --data",
            ) from error
        self.database = Database(folder / DATABASE_NAME)
        try:
            self.database.write(_migrate)
        except (CommandError, DatabaseError) as error:
            self.close()
            raise InputError(
                "data-folder",
                f"the database in {folder} is damaged or of a newer version of this program",
                "use the newer version, or another folder with --data",
            ) from error
        self.files = Blobs(folder)
        self.scans = Scans(self.database, self.files)
        self.documents = Documents(self.database, self.files)
        self.jobs = Jobs(self.database, self.files)
        self.sign_ins = SignIns(self.database)
        self.service_uuid = self.database.write(_identify)
        self._work = folder / "work"
        self._recover(settled_elsewhere)

    def work_folder(self, name: str) -> Path:
        """A fresh folder for work in progress; removed when the store is next opened."""
        folder = self._work / name
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        return folder

    def close(self) -> None:
        """Finish writing and let go of the folder."""
        self.database.close()
        self._lock.release()

    def _recover(self, settled_elsewhere: Collection[str]) -> None:
        shutil.rmtree(self._work, ignore_errors=True)
        self.database.write(idempotency.forget_stale)
        self.jobs.interrupt_running(error_fields(interrupted()), but=settled_elsewhere)
        self.files.sweep(self.database.read(known_files))


def refuse_foreign(folder: Path) -> None:
    """Keep away from folders with anybody's files: some names below are emptied at each start.

    Raises :class:`InputError` where ``folder`` holds any.
    """
    names = {path.name for path in folder.iterdir()} - _BEFORE_THE_DATABASE
    if names and not (folder / DATABASE_NAME).is_file():
        raise InputError(
            "data-folder",
            f"the folder {folder} holds other files ({min(names)}), and no data of this program",
            "give a new folder with --data",
        )


def _migrate(connection: Connection) -> None:
    config = Config()
    config.set_main_option("script_location", "service.store:migrations")
    config.attributes["connection"] = connection
    command.upgrade(config, "head")


def _identify(connection: Connection) -> str:
    found: str | None = connection.scalar(select(identity.c.service_uuid))
    if found is not None:
        return found
    created = str(uuid.uuid4())
    connection.execute(insert(identity).values(id=1, service_uuid=created, created_at=utc_now()))
    return created
