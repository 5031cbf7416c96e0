"""From a staged capture to a committed one, in steps that can be stopped anywhere.

A stage that holds its record is whole: every file the record names is durable, in the stage or
already in its place. From there :func:`publish` can be begun again and again and ends in the same
session. The one moment that counts is the replacing of ``session.json``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from rig.acquisition.session import places
from rig.acquisition.session.jsonfiles import entry, model_bytes, signed
from rig.acquisition.session.records import (
    CaptureEntry,
    CaptureRecord,
    InterruptedEntry,
    SessionFile,
)
from rig.acquisition.session.storage import Disk
from rig.acquisition.session.tables import Part, joined, part_of


@dataclass(frozen=True, eq=False)
class Books:
    """A session as it stands on the disk: its folder, its manifest, its records in order."""

    folder: Path
    disk: Disk
    manifest: SessionFile
    records: tuple[CaptureRecord, ...]
    parts: tuple[Part, ...] = ()
    """What the first of the records add to the tables, as far as that has been made."""

    def committed(self, capture_id: str) -> CaptureRecord | None:
        """The record of a committed capture."""
        return next((r for r in self.records if r.capture_id == capture_id), None)

    def interrupted(self, capture_id: str) -> InterruptedEntry | None:
        """The entry of a capture that was begun and not committed."""
        found = (e for e in self.manifest.interrupted if e.capture_id == capture_id)
        return next(found, None)

    @property
    def scratch(self) -> Path:
        """Where halves of files are written."""
        return self.folder / places.SCRATCH


def publish(books: Books, record: CaptureRecord) -> Books:
    """Commit a capture whose stage is whole."""
    stage = places.stage(books.folder, record.capture_id)
    _put_in_place(books, record, stage)
    data = model_bytes(record)
    path = places.record(record.number, record.capture_id)
    books.disk.replace(books.folder / path, data, books.scratch)
    listed = CaptureEntry(
        capture_id=record.capture_id,
        number=record.number,
        state=record.state,
        fired_at=record.fired_at,
        first_instant=record.first_instant,
        shots=record.shots,
        pictures=sum(not frame.raw for frame in record.frames),
        verdict=record.verdict,
        record=entry(path, data),
    )
    captures = [*books.manifest.captures, listed]
    done = write_books(
        replace(
            books,
            manifest=books.manifest.model_copy(update={"captures": captures}),
            records=(*books.records, record),
        )
    )
    clear_stage(books, stage)
    return done


def write_books(books: Books) -> Books:
    """Write the tables and then ``session.json``; returns the books as they are written."""
    listed = []
    made = (*books.parts, *map(part_of, books.records[len(books.parts) :]))
    for path, data in joined(made).items():
        books.disk.replace(books.folder / path, data, books.scratch)
        listed.append(entry(path, data))
    manifest = signed(books.manifest.model_copy(update={"tables": listed}))
    write_manifest(books, manifest)
    return replace(books, manifest=manifest, parts=made)


def write_manifest(books: Books, manifest: SessionFile) -> None:
    """Replace ``session.json``."""
    path = books.folder / places.SESSION
    books.disk.replace(path, model_bytes(manifest), books.scratch)


def _put_in_place(books: Books, record: CaptureRecord, stage: Path) -> None:
    folders = set()
    for frame in record.frames:
        source, target = stage / frame.file.path, books.folder / frame.file.path
        if source.exists():
            books.disk.make_folder(target.parent)
            books.disk.move(source, target)
        folders.add(target.parent)
    for folder in sorted(folders):
        books.disk.sync_folder(folder)


def set_aside(books: Books, aside: InterruptedEntry) -> Books:
    """List a capture as interrupted, and move what is left of it out of the way."""
    if books.interrupted(aside.capture_id) is None:
        # The list first: were the stage moved and the list lost, the id could fire again.
        interrupted = [*books.manifest.interrupted, aside]
        manifest = signed(books.manifest.model_copy(update={"interrupted": interrupted}))
        write_manifest(books, manifest)
        books = replace(books, manifest=manifest)
    stage = places.stage(books.folder, aside.capture_id)
    if stage.is_dir():
        target = books.folder / aside.folder
        while target.exists():
            target = target.with_name(f"{target.name}.more")
        books.disk.make_folder(target.parent)
        books.disk.move(stage, target)
        books.disk.sync_folder(target.parent)
    clear_stage(books, stage)
    return books


def clear_stage(books: Books, stage: Path) -> None:
    """Remove a stage, and the folder of stages when it was the last."""
    books.disk.remove(stage)
    books.disk.remove(books.scratch)
    left = books.folder / places.INCOMPLETE
    if left.is_dir() and not any(left.iterdir()):
        books.disk.remove(left)
