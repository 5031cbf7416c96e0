"""Browsers that signed in: kept by hash, so that a restart of the service signs nobody out."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy import Connection, Delete, delete, insert, select

from service.store.database import Database
from service.store.tables import sign_ins, time_text


@dataclass(frozen=True)
class SignIn:
    """A browser's sign-in: the hash of the key it was made with, and its end."""

    key_sha256: str
    ends_at: datetime


class SignIns:
    """All sign-ins; read from memory, because every request asks."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._lock = threading.Lock()
        database.write(_forget_ended)
        self._known = {
            row.sha256: SignIn(row.key_sha256, datetime.fromisoformat(row.ends_at))
            for row in database.read(lambda connection: connection.execute(select(sign_ins)).all())
        }

    def get(self, sha256: str) -> SignIn | None:
        """The sign-in whose token has this hash."""
        with self._lock:
            return self._known.get(sha256)

    def add(self, sha256: str, key_sha256: str, ends_at: datetime) -> None:
        """Keep a sign-in."""
        row = {"sha256": sha256, "key_sha256": key_sha256, "ends_at": time_text(ends_at)}

        def write(connection: Connection) -> None:
            _forget_ended(connection)
            connection.execute(insert(sign_ins).values(row))

        self._database.write(write)
        now = datetime.now(UTC)
        with self._lock:
            self._known = {k: known for k, known in self._known.items() if known.ends_at > now}
            self._known[sha256] = SignIn(key_sha256, ends_at)

    def remove(self, sha256: str) -> None:
        """End a sign-in."""
        with self._lock:
            self._known.pop(sha256, None)
        self._database.write(lambda connection: connection.execute(_one(sha256)))


def _one(sha256: str) -> Delete:
    return delete(sign_ins).where(sign_ins.c.sha256 == sha256)


def _forget_ended(connection: Connection) -> None:
    connection.execute(delete(sign_ins).where(sign_ins.c.ends_at <= time_text(datetime.now(UTC))))
