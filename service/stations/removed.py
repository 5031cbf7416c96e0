"""Sessions that somebody removed: out of sight, and restorable until their time of grace is over.

They lie in a hidden folder beside the others, each under its name and the moment it was removed.
"""

from __future__ import annotations

import shutil
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from common.errors import ConflictError, NotFoundError
from common.files.lock import LockHeldError, lock_folder
from service import logs

FOLDER = ".removed"
_STAMP = "%Y%m%dT%H%M%S%fZ"


@dataclass(frozen=True)
class RemovedFolder:
    """A removed session; it may be erased from ``until`` on."""

    id: str
    name: str
    removed_at: datetime
    until: datetime
    path: Path


class RemovedSessions:
    """What was removed from the folder ``sessions``. ``grace``: how long it can be restored."""

    def __init__(self, sessions: Path, grace: timedelta) -> None:
        self._sessions = sessions
        self._folder = sessions / FOLDER
        self._grace = grace

    def all(self) -> list[RemovedFolder]:
        """What can still be restored, last removed first; what can no longer be is erased now."""
        known, now = self._known(), datetime.now(UTC)
        for one in known:
            if one.until <= now:
                _erase(one)
        return [one for one in known if one.until > now]

    def get(self, removed_id: str) -> RemovedFolder:
        """One of them. Raises :class:`NotFoundError`."""
        for one in self.all():
            if one.id == removed_id:
                return one
        raise NotFoundError(
            "removed-session",
            f"there is no removed session {removed_id!r}, or not any more",
            "see /v1/removed-sessions",
        )

    def remove(self, folder: Path) -> RemovedFolder:
        """Put a session away. Raises :class:`ConflictError` while another process has it."""
        try:
            lock = lock_folder(folder)
        except LockHeldError as error:
            raise ConflictError(
                "session-busy",
                f"session {folder.name!r} is in use by another process",
                "end it, then ask again",
            ) from error
        try:
            self._folder.mkdir(exist_ok=True)
            removed_id = f"{folder.name}~{datetime.now(UTC).strftime(_STAMP)}"
            folder.rename(self._folder / removed_id)
        finally:
            lock.release()
        return self._read(self._folder / removed_id)

    def restore(self, removed_id: str) -> str:
        """Bring one back; its name. Raises :class:`ConflictError` where that is taken again."""
        one = self.get(removed_id)
        back = self._sessions / one.name
        if back.exists():
            raise ConflictError(
                "session-exists",
                f"there is a new session {one.name!r}",
                "remove that one first, or rename it",
            )
        one.path.rename(back)
        return one.name

    def erase(self, removed_id: str) -> None:
        """Erase one for good. Raises :class:`ConflictError` where some of it cannot be."""
        one = self.get(removed_id)
        if not _erase(one):
            raise ConflictError(
                "session-kept",
                f"not all of {one.path} can be erased",
                "see who may write there, then ask again",
            )

    def _known(self) -> list[RemovedFolder]:
        if not self._folder.is_dir():
            return []
        found = []
        for path in self._folder.iterdir():
            # What somebody else put there is left alone.
            with suppress(ValueError):
                found.append(self._read(path))
        return sorted(found, key=lambda one: one.removed_at, reverse=True)

    def _read(self, path: Path) -> RemovedFolder:
        name, _, stamp = path.name.rpartition("~")
        at = datetime.strptime(stamp, _STAMP).replace(tzinfo=UTC)
        return RemovedFolder(path.name, name, at, at + self._grace, path)


def _erase(one: RemovedFolder) -> bool:
    """Whether nothing is left of it; what is left is tried again with the next list."""
    shutil.rmtree(one.path, ignore_errors=True)
    gone = not one.path.exists()
    logs.log.info(
        "session erased" if gone else "session not erased",
        extra={"fields": {"session": one.name, "path": str(one.path)}},
    )
    return gone
