"""The design folder: everything a design leaves behind, written whole or not at all."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from common.files.folders import refuse_others, whole_folder
from common.files.reading import json_in
from geometry.preparation import PreparedSubject
from rig.design.designfile import SCHEMA, design_document
from rig.design.layout import Layout
from rig.design.layoutfile import layout_csv, layout_document
from rig.report import render_report
from rig.report.scene import scene_glb
from rig.specification.spec import RigSpec
from solver.result import Design, PointTable

FILE_NAMES = ("design.json", "layout.json", "layout.csv", "points.csv", "scene.glb", "report.html")
MEDIA_TYPES: Mapping[str, str] = {
    "design.json": "application/json",
    "layout.json": "application/json",
    "layout.csv": "text/csv; charset=utf-8",
    "points.csv": "text/csv; charset=utf-8",
    "scene.glb": "model/gltf-binary",
    "report.html": "text/html; charset=utf-8",
}
POINT_COLUMNS = (
    "x_mm",
    "y_mm",
    "z_mm",
    "sigma_mm",
    "start_sigma_mm",
    "views",
    "start_views",
    "in_focus_views",
)


def json_text(document: dict[str, Any]) -> str:
    """JSON as it is filed: readable at the top, one line per long list, never NaN."""
    return json.dumps(document, allow_nan=False, ensure_ascii=False, separators=(", ", ": ")) + "\n"


def points_csv(table: PointTable, start: PointTable) -> str:
    """Per point where it is, its sigma and its views, in the design and at the start."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(POINT_COLUMNS)
    rows = zip(
        table.points.points_mm,
        table.sigma_mm,
        start.sigma_mm,
        table.views,
        start.views,
        table.in_focus,
        strict=True,
    )
    for place, sigma, before, views, views_before, sharp in rows:
        writer.writerow(
            [
                *(f"{v:.3f}" for v in place),
                f"{sigma:.6g}",
                f"{before:.6g}",
                int(views),
                int(views_before),
                int(sharp),
            ]
        )
    return text.getvalue()


def design_files(
    design: Design, layout: Layout, prepared: PreparedSubject, spec: RigSpec, scan_name: str = ""
) -> dict[str, Callable[[], bytes]]:
    """How to make each file of the folder, by name; nothing is made before it is called."""
    points, start = design.quality.points, design.start_quality.points
    return {
        "design.json": lambda: json_text(
            design_document(design, spec=spec, scan=prepared.scan, scan_name=scan_name)
        ).encode(),
        "layout.json": lambda: json_text(layout_document(layout)).encode(),
        "layout.csv": lambda: layout_csv(layout).encode(),
        "points.csv": lambda: points_csv(points, start).encode(),
        "scene.glb": lambda: scene_glb(design.cameras, prepared.subject.occluder),
        "report.html": lambda: _report(design, prepared, spec, layout, scan_name).encode(),
    }


def _report(
    design: Design, prepared: PreparedSubject, spec: RigSpec, layout: Layout, scan_name: str
) -> str:
    return render_report(
        design, prepared.subject, layout, title=spec.name, scan_name=scan_name, notes=prepared.notes
    )


def write_design_folder(
    out: Path,
    design: Design,
    layout: Layout,
    prepared: PreparedSubject,
    spec: RigSpec,
    scan_name: str = "",
) -> dict[str, Path]:
    """Write all files of a design to the folder ``out``; returns their paths by name.

    The files are written to a folder beside it that is then renamed, so ``out`` never holds
    half a design. A former design in ``out`` is replaced; a folder that holds anything else, or
    files of these names without a design, is a :class:`ConflictError`: they would be lost.
    """
    check_design_folder(out)
    makers = design_files(design, layout, prepared, spec, scan_name)
    with whole_folder(out, check_design_folder) as half:
        for name, make in makers.items():
            (half / name).write_bytes(make())
    return {name: out / name for name in makers}


def check_design_folder(out: Path) -> None:
    """Raise when a design cannot be written to ``out``; call it before a long solve."""
    refuse_others(out, FILE_NAMES if _holds_design(out) else ())


def _holds_design(out: Path) -> bool:
    try:
        document = json_in(out / "design.json")
        return bool(document["schema"] == SCHEMA)
    except (OSError, ValueError, KeyError, TypeError):
        return False
