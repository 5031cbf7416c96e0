"""The one store of the service: records in SQLite, files by content hash beside it."""

from __future__ import annotations

import re
import secrets
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
from service.logs import log
from service.store import idempotency
from service.store.blobs import Blobs, known_files
from service.store.database import Database
from service.store.documents import Documents
from service.store.jobs import Jobs
from service.store.lock import FolderLock
from service.store.ours import DATABASE_NAME, refuse_foreign
from service.store.scans import Scans
from service.store.signins import SignIns
from service.store.tables import identity, jobs, utc_now

__all__ = ["DATABASE_NAME", "Store", "interrupted", "refuse_foreign"]

_IMPORT = re.compile(r"import-[0-9a-f]{16}")
"""Folders in which uploads are read (:meth:`Store.import_folder`)."""


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
            raise _unusable(folder, error) from error
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
        try:
            self.files = Blobs(folder)
            self._work = folder / "work"
            self._work.mkdir(exist_ok=True)
        except OSError as error:
            self.close()
            raise _unusable(folder, error) from error
        self.scans = Scans(self.database, self.files)
        self.documents = Documents(self.database, self.files)
        self.jobs = Jobs(self.database, self.files)
        self.sign_ins = SignIns(self.database)
        self.service_uuid = self.database.write(_identify)
        self._recover(settled_elsewhere)

    def work_folder(self, job_id: str) -> Path:
        """A fresh folder for a job at work; removed when the store is next opened."""
        folder = self._work / job_id
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        return folder

    def import_folder(self) -> Path:
        """A fresh folder to read an upload in; removed when the store is next opened."""
        return self.work_folder(f"import-{secrets.token_hex(8)}")

    def close(self) -> None:
        """Finish writing and let go of the folder."""
        self.database.close()
        self._lock.release()

    def _recover(self, settled_elsewhere: Collection[str]) -> None:
        kept = self._sweep_work()
        self.database.write(idempotency.forget_stale)
        self.jobs.interrupt_running(error_fields(interrupted()), but=settled_elsewhere)
        kept += self.files.sweep(self.database.read(known_files))
        if kept:
            fields = {"folder": str(self.folder), "files": sorted(path.name for path in kept)[:20]}
            log.warning(
                "files of others in the data folder are left alone", extra={"fields": fields}
            )

    def _sweep_work(self) -> list[Path]:
        """Remove the folders of jobs and uploads that a crash has left; what else is there."""
        if self._work.is_symlink():
            return [self._work]
        known = self.database.read(lambda c: set(c.scalars(select(jobs.c.id))))
        kept = []
        for path in self._work.iterdir():
            ours = path.name in known or _IMPORT.fullmatch(path.name)
            if ours and path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                kept.append(path)
        return kept


def _unusable(folder: Path, error: OSError) -> InputError:
    return InputError(
        "data-folder",
        f"the data folder {folder} cannot be used ({error.strerror})",
        "give a folder you may write to with --data",
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
