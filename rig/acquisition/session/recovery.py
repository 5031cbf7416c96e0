"""What a crash left behind, made whole or put aside.

A capture whose record was staged is whole, and is committed now. Of one that was armed and has no
record nobody knows whether it fired: it is listed as interrupted and its id refused from then on.
One that was never armed left nothing worth keeping.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from common.errors import InputError
from common.files.reading import plain_bytes
from rig.acquisition.session import paths
from rig.acquisition.session.commit import clear_stage, publish, set_aside, write_index
from rig.acquisition.session.index import SessionIndex
from rig.acquisition.session.jsonfiles import read_model
from rig.acquisition.session.records import CaptureRecord, FileEntry, InterruptedEntry
from rig.acquisition.session.storage import file_sha256, sha256
from rig.acquisition.session.tables import tables


@dataclass(frozen=True)
class Recovery:
    """What was done, by capture id. Empty lists: there was nothing to do."""

    committed: tuple[str, ...] = ()
    set_aside: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    """Files in the way that somebody else wrote, by their paths in the session."""


def recover_index(
    index: SessionIndex, known: InterruptedEntry | None = None
) -> tuple[SessionIndex, Recovery]:
    """Deal with everything that is incomplete; doing it again changes nothing.

    ``known``: what is known of one capture, should it have to be set aside.
    """
    left = index.folder / paths.INCOMPLETE
    if left.is_symlink():
        raise InputError(
            "session-damaged", f"{left} is a link, and no folder of this program", "move it away"
        )
    if not left.is_dir():
        return index, Recovery()
    before = _changed(index)
    committed, aside, dropped = [], [], []
    for stage in sorted(left.iterdir()):
        name = stage.name
        ours = paths.CAPTURE_ID.fullmatch(name) and stage.is_dir() and not stage.is_symlink()
        if not ours:
            continue
        if index.committed(name) is not None:
            clear_stage(index, stage)
            continue
        record = _whole_record(index, stage)
        if record is not None:
            index = publish(index, record)
            committed.append(name)
        elif (stage / paths.INTENT).exists() or index.interrupted(name) is not None:
            entry = interrupted(name, "unknown", "the program was stopped")
            told = known is not None and known.capture_id == name
            index = set_aside(index, known if told and known is not None else entry)
            aside.append(name)
        else:
            clear_stage(index, stage)
            if not stage.exists():
                dropped.append(name)
    index = _renew_tables(index)
    index.disk.sweep(index.scratch, paths.HALF.fullmatch)
    index.disk.sweep(left, lambda _: False)
    kept = [path for path in sorted(left.rglob("*")) if path.is_symlink() or not path.is_dir()]
    kept += sorted(_changed(index) - before)
    others = tuple(path.relative_to(index.folder).as_posix() for path in kept)
    return index, Recovery(tuple(committed), tuple(aside), tuple(dropped), others)


def _changed(index: SessionIndex) -> set[Path]:
    """What was kept aside so far."""
    return set(index.folder.rglob(f"*{paths.CHANGED}"))


def interrupted(capture_id: str, fate: str, why: str) -> InterruptedEntry:
    """The entry of a capture that was begun and is not committed."""
    return InterruptedEntry.model_validate(
        {
            "capture_id": capture_id,
            "fate": fate,
            "why": why,
            "at": datetime.now(UTC).astimezone().isoformat(timespec="seconds"),
            "folder": f"{paths.INTERRUPTED}/{capture_id}",
        }
    )


def _whole_record(index: SessionIndex, stage: Path) -> CaptureRecord | None:
    """The record of a stage, when everything it names is there and right."""
    try:
        data = plain_bytes(stage / paths.STAGED_RECORD)
        record = read_model(CaptureRecord, data, paths.STAGED_RECORD)
    except (OSError, InputError):
        return None
    numbers = {known.number for known in index.records}
    sound = record.capture_id == stage.name and record.number not in numbers
    whole = sound and all(_there(index, stage, frame.file) for frame in record.frames)
    return record if whole else None


def _there(index: SessionIndex, stage: Path, listed: FileEntry) -> bool:
    staged, placed = stage / listed.path, index.folder / listed.path
    path = staged if staged.exists() else placed
    return path.is_file() and file_sha256(path) == listed.sha256


def _renew_tables(index: SessionIndex) -> SessionIndex:
    """Tables that were written for a capture that was then not committed are made anew."""
    for path, data in tables(index.records).items():
        file = index.folder / path
        if not file.is_file() or file_sha256(file) != sha256(data):
            return write_index(index)
    return index
