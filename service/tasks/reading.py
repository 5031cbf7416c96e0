"""Reads an uploaded scan. Apart from the other tasks, to start without the solver."""

from __future__ import annotations

from collections.abc import Iterable

from geometry.reading import read_scan
from geometry.scan import ScanNote
from service.jobs.engine import Running, Task
from service.kinds.base import Note
from service.kinds.imports import ScanFacts, ScanImportRequest


def import_scan(task: Task[ScanImportRequest, ScanFacts], running: Running) -> ScanFacts:
    """Tell what is in the input ``upload`` and what was inferred or changed to read it."""
    del running
    scan = read_scan(task.inputs["upload"], task.request.options.to_options())
    return ScanFacts(
        vertices=len(scan.vertices_mm),
        faces=len(scan.faces),
        extents_mm=[round(float(extent), 3) for extent in scan.extents_mm],
        notes=notes_of(scan.notes),
    )


def notes_of(notes: Iterable[ScanNote]) -> list[Note]:
    """What a reader noted, for a result."""
    return [Note(kind=note.kind, text=note.text) for note in notes]
