"""Reads a scan and tells what was understood. Apart from the other tasks, to start light."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from common.progress import Progress
from geometry.arrays import Floats
from geometry.reading import read_scan
from geometry.scan import FacePlace, Scan, ScanNote
from geometry.units import MM_PER_UNIT
from service.jobs.engine import Running, Task
from service.kinds.base import Note
from service.kinds.imports import ScanFace, ScanFacts, ScanImportRequest

SCAN_PICTURE = "scan.png"


def import_scan(task: Task[ScanImportRequest, ScanFacts], running: Running) -> ScanFacts:
    """Tell what is in the input ``upload`` and how it was understood; draw it where asked."""
    running.report(Progress("reading the scan", 0.0))
    scan = read_scan(task.inputs["upload"], task.request.options.to_options())
    if task.request.picture:
        from rig.report.scan_picture import scan_picture

        running.report(Progress("drawing the scan", 0.8))
        (task.folder / SCAN_PICTURE).write_bytes(scan_picture(scan))
    return facts_of(scan)


def facts_of(scan: Scan) -> ScanFacts:
    """What was understood of a scan. ``up`` and ``front`` are unit vectors of the file."""
    scale = float(np.cbrt(np.linalg.det(scan.rig_from_file[:3, :3])))
    rotation = scan.rig_from_file[:3, :3] / scale
    units = [name for name, value in MM_PER_UNIT.items() if np.isclose(value, scale, rtol=1e-9)]
    return ScanFacts(
        vertices=len(scan.vertices_mm),
        faces=len(scan.faces),
        extents_mm=_rounded(scan.extents_mm, 3),
        units=units[0] if units else None,
        mm_per_unit=float(f"{scale:.9g}"),
        up=_rounded(rotation[2], 6),
        front=_rounded(-rotation[1], 6),
        rig_from_file=_rounded(scan.rig_from_file, 9),
        face=None if scan.face is None else _face_facts(scan.face, scale, rotation),
        notes=notes_of(scan.notes),
    )


def _face_facts(face: FacePlace, scale: float, rotation: Floats) -> ScanFace:
    names = ("left", "back", "up")
    in_file = face.axes_rig @ rotation
    return ScanFace(
        confidence=round(face.confidence, 3),
        nose_tip_file=[float(f"{v:.9g}") for v in face.nose_tip_mm @ rotation / scale],
        nose_tip_rig_mm=_rounded(face.nose_tip_mm, 3),
        axes_file={n: _rounded(row, 6) for n, row in zip(names, in_file, strict=True)},
        axes_rig={n: _rounded(row, 6) for n, row in zip(names, face.axes_rig, strict=True)},
    )


def _rounded(values: Floats, digits: int) -> Any:  # noqa: ANN401 - nested lists
    return (np.round(values, digits) + 0.0).tolist()


def notes_of(notes: Iterable[ScanNote]) -> list[Note]:
    """What a reader noted, for a result."""
    return [Note(kind=note.kind, text=note.text) for note in notes]
