"""Where the service says which rigs are its own, so that a command on the same computer finds it.

A note is a lock file beside those of the devices, one per station file: the system lets go of it
when the service dies, so a note that nobody holds is nobody's.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit, urlunsplit

from pydantic import ValidationError

from common.files.lock import KernelLock, LockHeldError, held_note, lock_file
from common.files.strict import StrictModel
from rig.acquisition.station.locks import lock_folder, lock_name
from rig.acquisition.station.spec import Station

_ADMINISTRATOR = 0
_TRIES, _PAUSE_S = 20, 0.01
"""Whoever looks at a note holds it for a moment."""


class ServiceNote(StrictModel):
    """What a service says of one of its rigs.

    ``sessions``: the folder it files captures in; ``certificate``: the file it proves itself with.
    """

    url: str
    rig: str
    sessions: str
    certificate: str | None = None


@dataclass(frozen=True)
class FoundService:
    """A note that somebody holds. ``own``: this user or the administrator wrote it."""

    note: ServiceNote
    own: bool


@contextmanager
def noted(
    url: str,
    stations: Sequence[Station],
    sessions: Path,
    certificate: Path | None = None,
    folder: Path | None = None,
) -> Iterator[None]:
    """Say that the service at ``url`` runs these rigs. ``folder``: where lock files lie.

    A station whose note another service holds, or that cannot be written, goes without one.
    """
    with ExitStack() as held:
        for station in stations:
            if station.path is None:
                continue
            note = ServiceNote(
                url=_reachable(url),
                rig=station.name,
                sessions=str(sessions),
                certificate=None if certificate is None else str(certificate.resolve()),
            )
            with suppress(LockHeldError, OSError):
                lock = _taken(_note_file(station.path, folder), note.model_dump_json())
                held.callback(lock.release)
        yield


def find_service(station: Path, folder: Path | None = None) -> FoundService | None:
    """The service that runs the rig of a station file; None where none does."""
    with suppress(OSError, ValidationError):
        found = held_note(_note_file(station, folder))
        if found is not None:
            text, user = found
            return FoundService(
                ServiceNote.model_validate_json(text), user in (_ADMINISTRATOR, os.getuid())
            )
    return None


def _note_file(station: Path, folder: Path | None) -> Path:
    return (folder or lock_folder()) / lock_name(f"service of station {station.resolve()}")


def _taken(path: Path, note: str) -> KernelLock:
    path.parent.mkdir(parents=True, exist_ok=True)
    for _ in range(_TRIES):
        with suppress(LockHeldError):
            return lock_file(path, note)
        time.sleep(_PAUSE_S)
    return lock_file(path, note)


def _reachable(url: str) -> str:
    """The address as this computer asks for it: nobody can call 0.0.0.0 everywhere."""
    parts = urlsplit(url)
    own = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(parts.hostname or "")  # noqa: S104
    if own is None:
        return url
    return urlunsplit(parts._replace(netloc=f"{own}:{parts.port}"))
