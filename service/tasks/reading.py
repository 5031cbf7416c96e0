"""Reads an uploaded scan. Apart from the other tasks, to start without the solver."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from common.progress import CancelToken, ProgressCallback
from geometry.reading import read_scan
from rig.specification.sections.subject import ScanSection


def import_scan(
    request: Mapping[str, Any],
    inputs: Mapping[str, Path],
    folder: Path,
    report: ProgressCallback,
    cancel: CancelToken,
) -> dict[str, Any]:
    """Tell what is in a scan and what was inferred or changed to read it."""
    del folder, report, cancel
    scan = read_scan(inputs["upload"], ScanSection.model_validate(request["options"]).to_options())
    return {
        "vertices": len(scan.vertices_mm),
        "faces": len(scan.faces),
        "extents_mm": [round(float(extent), 3) for extent in scan.extents_mm],
        "notes": [{"kind": note.kind, "text": note.text} for note in scan.notes],
    }
