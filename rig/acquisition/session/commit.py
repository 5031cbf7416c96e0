"""From a staged capture to a committed one, in steps that can be stopped anywhere.

A stage that holds its record is whole: every file the record names is durable, in the stage or
already in its place. From there :func:`publish` can be begun again and again and ends in the same
session. The one moment that counts is the replacing of ``session.json``.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from rig.acquisition.session import paths
from rig.acquisition.session.index import SessionIndex
from rig.acquisition.session.jsonfiles import entry, model_bytes, signed
from rig.acquisition.session.records import (
    CaptureEntry,
    CaptureRecord,
    InterruptedEntry,
    SessionFile,
)
from rig.acquisition.session.storage import file_sha256, sha256
from rig.acquisition.session.tables import joined, rows_of


def publish(index: SessionIndex, record: CaptureRecord) -> SessionIndex:
    """Commit a capture whose stage is whole."""
    stage = paths.stage(index.folder, record.capture_id)
    _put_in_place(index, record, stage)
    data = model_bytes(record)
    path = paths.record(record.number, record.capture_id)
    index.disk.replace(index.folder / path, data, index.scratch)
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
    captures = [*index.manifest.captures, listed]
    done = write_index(
        replace(
            index,
            manifest=index.manifest.model_copy(update={"captures": captures}),
            records=(*index.records, record),
        )
    )
    clear_stage(index, stage)
    return done


def write_index(index: SessionIndex) -> SessionIndex:
    """Write the tables and then ``session.json``; returns the index as it is written."""
    listed = []
    made = (*index.rows, *map(rows_of, index.records[len(index.rows) :]))
    for path, data in joined(made).items():
        _keep_changed(index, path, data)
        index.disk.replace(index.folder / path, data, index.scratch)
        listed.append(entry(path, data))
    manifest = signed(index.manifest.model_copy(update={"tables": listed}))
    write_manifest(index, manifest)
    return replace(index, manifest=manifest, rows=made)


def write_manifest(index: SessionIndex, manifest: SessionFile) -> None:
    """Replace ``session.json``."""
    path = index.folder / paths.SESSION
    index.disk.replace(path, model_bytes(manifest), index.scratch)


def _put_in_place(index: SessionIndex, record: CaptureRecord, stage: Path) -> None:
    folders = set()
    for frame in record.frames:
        source, target = stage / frame.file.path, index.folder / frame.file.path
        if source.exists():
            index.disk.make_folder(target.parent)
            keep_aside(index, target)
            index.disk.move(source, target)
        folders.add(target.parent)
    for folder in sorted(folders):
        index.disk.sync_folder(folder)


def _keep_changed(index: SessionIndex, path: str, data: bytes) -> None:
    """Somebody may have worked in a table: what was not written here is not written over."""
    written = {entry.sha256 for entry in index.manifest.tables if entry.path == path}
    place = index.folder / path
    if place.is_symlink() or (
        place.is_file() and file_sha256(place) not in written | {sha256(data)}
    ):
        keep_aside(index, place)


def keep_aside(index: SessionIndex, place: Path) -> None:
    """Free a name that somebody's file has; it stays beside, as ``.changed``."""
    if not os.path.lexists(place):
        return
    aside = place.with_name(f"{place.name}{paths.CHANGED}")
    while os.path.lexists(aside):
        aside = aside.with_name(f"{aside.name}{paths.CHANGED}")
    index.disk.move(place, aside)


def set_aside(index: SessionIndex, aside: InterruptedEntry) -> SessionIndex:
    """List a capture as interrupted, and move what is left of it out of the way."""
    if index.interrupted(aside.capture_id) is None:
        # The list first: were the stage moved and the list lost, the id could fire again.
        interrupted = [*index.manifest.interrupted, aside]
        manifest = signed(index.manifest.model_copy(update={"interrupted": interrupted}))
        write_manifest(index, manifest)
        index = replace(index, manifest=manifest)
    stage = paths.stage(index.folder, aside.capture_id)
    if stage.is_dir():
        target = index.folder / aside.folder
        while target.exists():
            target = target.with_name(f"{target.name}.more")
        index.disk.make_folder(target.parent)
        index.disk.move(stage, target)
        index.disk.sync_folder(target.parent)
    clear_stage(index, stage)
    return index


def clear_stage(index: SessionIndex, stage: Path) -> None:
    """Remove what was written in a stage, and the folder of stages when it was the last."""
    index.disk.sweep(stage, paths.STAGED.fullmatch)
    index.disk.sweep(index.scratch, paths.HALF.fullmatch)
    left = index.folder / paths.INCOMPLETE
    if left.is_dir() and not any(left.iterdir()):
        index.disk.sweep(left, paths.HALF.fullmatch)
