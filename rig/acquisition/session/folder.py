"""A session: a plain folder that holds what was photographed of one subject at one sitting."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

from common.closing import Closing
from common.errors import ConflictError, InputError, NotFoundError
from common.files.lock import KernelLock, LockHeldError, lock_folder
from common.version import program_version
from rig.acquisition.session import paths
from rig.acquisition.session.commit import write_index
from rig.acquisition.session.index import SessionIndex, read_index
from rig.acquisition.session.jsonfiles import entry
from rig.acquisition.session.records import CaptureRecord, InterruptedEntry, SessionFile
from rig.acquisition.session.recovery import Recovery, recover_index
from rig.acquisition.session.storage import Disk, disk_errors

CAPTURE_ID = paths.CAPTURE_ID
MEGABYTE = 1e6


@dataclass(frozen=True)
class SessionPlan:
    """What a new session is about. ``rig_files``: the content of its folder ``rig``, by path.

    ``rig_sha256`` names the rig: sessions are continued only with the same one.
    """

    station: str
    rig_sha256: str
    rig_files: Mapping[str, bytes] = field(default_factory=dict)
    subject: str = ""
    operator: str = ""


class Session(Closing):
    """An open session; one process at a time has it. Closing lets another have it."""

    def __init__(self, index: SessionIndex, lock: KernelLock, recovery: Recovery) -> None:
        self.index = index
        self.recovery = recovery
        self._lock = lock

    @classmethod
    def create(cls, folder: Path, plan: SessionPlan, disk: Disk | None = None) -> Self:
        """Begin a session in a new folder; it appears whole or not at all.

        Raises :class:`ConflictError` ``session-exists`` when the folder is there already.
        """
        disk = Disk() if disk is None else disk
        half = folder.with_name(f".{folder.name}.{secrets.token_hex(4)}.part")
        with disk_errors(folder.parent):
            _require_new(folder)
            disk.make_folder(folder.parent)
            _remove_stale(folder, plan, disk)
            disk.make_folder(half)
            # The lock is on the folder itself and stays with it when it is renamed.
            lock = _locked(half)
            try:
                index = _begin(half, plan, disk)
                _require_new(folder)
                disk.move(half, folder)
                disk.sync_folder(folder.parent)
            except BaseException:
                lock.release()
                disk.remove(half)
                raise
        return cls(SessionIndex(folder, disk, index.manifest, ()), lock, Recovery())

    @classmethod
    def open(cls, folder: Path, disk: Disk | None = None) -> Self:
        """Open a session and bring in order what a crash left.

        Raises :class:`NotFoundError` where there is none, :class:`ConflictError`
        ``session-busy`` while another process has it, :class:`InputError` for a damaged one.
        """
        disk = Disk() if disk is None else disk
        lock = _locked(folder)
        try:
            with disk_errors(folder):
                index, recovery = recover_index(read_index(folder, disk))
        except BaseException:
            lock.release()
            raise
        return cls(index, lock, recovery)

    @property
    def folder(self) -> Path:
        """Where it lies."""
        return self.index.folder

    @property
    def manifest(self) -> SessionFile:
        """What ``session.json`` says."""
        return self.index.manifest

    @property
    def next_number(self) -> int:
        """The number the next capture gets."""
        return max((record.number for record in self.index.records), default=0) + 1

    @property
    def next_instant(self) -> int:
        """The number of the next capture's first instant: the name of its pictures."""
        ends = [record.first_instant + record.shots for record in self.index.records]
        return max(ends, default=1)

    def committed(self, capture_id: str) -> CaptureRecord | None:
        """The record of a committed capture, None when there is none of that id.

        Raises :class:`ConflictError` ``capture-unknown`` for one that was interrupted, and
        :class:`InputError` for what is no id.
        """
        if not CAPTURE_ID.fullmatch(capture_id):
            raise InputError(
                "capture-id",
                f"{capture_id!r} is no capture id",
                "give 1 to 64 letters, digits, '-', '_' or '.', a letter or digit first",
            )
        lost = self.index.interrupted(capture_id)
        if lost is not None:
            told = "may have fired" if lost.fate == "unknown" else "fired"
            raise ConflictError(
                "capture-unknown",
                f"capture {capture_id} was interrupted after it {told} ({lost.why})",
                "take a new capture under another id",
            )
        return self.index.committed(capture_id)

    def tidy(self, known: InterruptedEntry | None = None) -> None:
        """Bring in order what a failed write of this very process left behind.

        What the disk says counts, not what this process believes: the failure may have come
        after the capture was committed. ``known`` as for :func:`recover_books`.
        """
        if (self.folder / paths.INCOMPLETE).exists():
            with disk_errors(self.folder):
                on_disk = read_index(self.folder, self.index.disk)
                self.index, self.recovery = recover_index(on_disk, known)

    def require_space(self, least_mb: float) -> None:
        """Raise :class:`ConflictError` ``disk-full`` when less is free."""
        with disk_errors(self.folder):
            free_mb = self.index.disk.free_bytes(self.folder) / MEGABYTE
        if free_mb < least_mb:
            raise ConflictError(
                "disk-full",
                f"{free_mb:.0f} MB are free for {self.folder}, {least_mb:.0f} MB are asked for",
                "free some, lower min_free_mb, or choose a session on another disk",
            )

    def close(self) -> None:
        """Let go of it; closing twice changes nothing."""
        self._lock.release()


def session_folder(root: Path, subject: str, now: datetime | None = None) -> Path:
    """The usual place for a new session: ``sub-<subject>/ses-<yyyymmddThhmmss>``."""
    now = datetime.now(UTC).astimezone() if now is None else now
    # Composed, so that a letter with its accent is one letter on every disk; all letters stay.
    composed = unicodedata.normalize("NFC", subject)
    name = "".join(letter for letter in composed if letter.isalnum()) or "unnamed"
    return root / f"sub-{name}" / f"ses-{now:%Y%m%dT%H%M%S}"


def _remove_stale(folder: Path, plan: SessionPlan, disk: Disk) -> None:
    """Remove beginnings of this session that a crash left; those being made are locked.

    Only what a beginning is made of goes; with anything else in it, all stays.
    """
    ours = {paths.SESSION, *paths.TABLES, *plan.rig_files}
    scratch = f"{paths.SCRATCH}/"

    def begun(name: str) -> bool:
        half = name.startswith(scratch) and paths.HALF.fullmatch(name.removeprefix(scratch))
        return name in ours or bool(half)

    form = re.compile(rf"\.{re.escape(folder.name)}\.[0-9a-f]{{8}}\.part")
    for half in folder.parent.iterdir():
        if not form.fullmatch(half.name) or half.is_symlink():
            continue
        with contextlib.suppress(ConflictError, NotFoundError):
            lock = _locked(half)
            try:
                files = (p for p in half.rglob("*") if p.is_symlink() or not p.is_dir())
                if all(begun(path.relative_to(half).as_posix()) for path in files):
                    disk.sweep(half, begun)
            finally:
                lock.release()


def _begin(half: Path, plan: SessionPlan, disk: Disk) -> SessionIndex:
    for path, data in plan.rig_files.items():
        disk.make_folder((half / path).parent)
        disk.write(half / path, data)
        disk.sync_folder((half / path).parent)
    manifest = SessionFile(
        schema="rigwright.session/1",
        rigwright=program_version(),
        session_id=secrets.token_hex(16),
        subject=plan.subject,
        operator=plan.operator,
        created_at=datetime.now(UTC).astimezone().isoformat(timespec="seconds"),
        station=plan.station,
        rig_sha256=plan.rig_sha256,
        rig=[entry(path, data) for path, data in plan.rig_files.items()],
        captures=[],
        tables=[],
        interrupted=[],
        digest="",
    )
    index = write_index(SessionIndex(half, disk, manifest, ()))
    disk.remove(half / paths.INCOMPLETE)
    return index


def _require_new(folder: Path) -> None:
    # An empty folder is one that somebody made for the session.
    empty = folder.is_dir() and not folder.is_symlink() and not any(folder.iterdir())
    if os.path.lexists(folder) and not empty:
        raise ConflictError(
            "session-exists", f"{folder} is there already", "open it, or choose a new folder"
        )


def _locked(folder: Path) -> KernelLock:
    """The lock on the folder itself: no file of its own that a copy would carry along."""
    try:
        return lock_folder(folder)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise NotFoundError(
            "session-not-found", f"{folder} is not a session", "give a session's folder"
        ) from error
    except LockHeldError:
        raise ConflictError(
            "session-busy",
            f"another process works on the session {folder}",
            "wait for it, or stop it",
        ) from None
