"""SQLite with one writer thread and many readers.

SQLite lets one connection write at a time. Instead of letting writers collide and wait for each
other's locks, all changes go through one thread in the order in which they were asked for.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, TypeVar

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.exc import OperationalError

from common.errors import InternalError

T = TypeVar("T")

_BUSY_TIMEOUT_MS = 5000


def _engine(path: Path, *, begin: str, query_only: bool) -> Engine:
    engine = create_engine(f"sqlite:///{path}")

    @event.listens_for(engine, "connect")
    def _prepare(connection: Any, _record: Any) -> None:  # noqa: ANN401 - SQLAlchemy's untyped hook
        # The driver must not begin transactions by itself: it would begin deferred ones, and
        # those fail half-way when another process holds the lock.
        connection.isolation_level = None
        cursor = connection.cursor()
        cursor.execute(f"PRAGMA busy_timeout = {_BUSY_TIMEOUT_MS}")
        cursor.execute("PRAGMA journal_mode = WAL")
        # FULL: what a client was told is finished survives a loss of power, not only a crash.
        cursor.execute("PRAGMA synchronous = FULL")
        cursor.execute("PRAGMA foreign_keys = ON")
        cursor.execute(f"PRAGMA query_only = {'ON' if query_only else 'OFF'}")
        cursor.close()

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        connection.exec_driver_sql(begin)

    return engine


class _Change:
    """One change on its way to the writer thread and its outcome on the way back."""

    def __init__(
        self, change: Callable[[Connection], Any], after: Callable[[], None] | None
    ) -> None:
        self.change = change
        self.after = after
        self.outcome: Future[Any] = Future()


class Database:
    """One SQLite file. ``write`` and ``read`` may be called from any thread."""

    def __init__(self, path: Path) -> None:
        self._writes: queue.SimpleQueue[_Change | None] = queue.SimpleQueue()
        self._writing = _engine(path, begin="BEGIN IMMEDIATE", query_only=False)
        self._reading = _engine(path, begin="BEGIN", query_only=True)
        self._closed = threading.Event()
        self._refused = ""
        self._thread = threading.Thread(target=self._write_loop, name="store-writer", daemon=True)
        self._thread.start()

    def read(self, query: Callable[[Connection], T]) -> T:
        """What ``query`` returns, on a consistent snapshot."""
        with self._reading.connect() as connection, connection.begin():
            return query(connection)

    def write(
        self, change: Callable[[Connection], T], after: Callable[[], None] | None = None
    ) -> T:
        """Run ``change`` in one transaction on the writer thread and wait until it is durable.

        An exception in ``change`` undoes the transaction and is raised here. ``after`` runs on
        the writer thread once the change is durable, before any later change.
        """
        if self._closed.is_set():
            raise InternalError("store-closed", "the store is closed", "start the service again")
        item = _Change(change, after)
        self._writes.put(item)
        return item.outcome.result()  # type: ignore[no-any-return]

    @property
    def refused(self) -> str:
        """Why the last change could not be written; empty when it could."""
        return self._refused

    def close(self) -> None:
        """Finish the changes that were asked for and let go of the file."""
        self._closed.set()
        self._writes.put(None)
        self._thread.join()
        self._reading.dispose()
        self._writing.dispose()

    def _write_loop(self) -> None:
        while (item := self._writes.get()) is not None:
            try:
                with self._writing.connect() as connection, connection.begin():
                    outcome = item.change(connection)
                self._refused = ""
                if item.after is not None:
                    item.after()
            except OperationalError as error:
                self._refused = str(error.orig)
                item.outcome.set_exception(error)
            except BaseException as error:  # noqa: BLE001 - handed to the caller, who waits for it
                item.outcome.set_exception(error)
            else:
                item.outcome.set_result(outcome)
