"""The work itself: the one place where the service meets geometry, solver and rig.

Everything here runs in the process of a task, where it may take its time.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import trimesh

from common.files.plain import plain
from common.progress import CancelToken, Progress, ProgressCallback
from geometry.camera import RigCamera
from geometry.preparation import PreparedSubject, prepare_subject
from geometry.reading import read_scan
from geometry.scan import Scan
from rig.design.designfile import evaluation_document
from rig.design.layout import Layout, make_layout
from rig.report.designfolder import write_design_folder
from rig.specification.spec import RigSpec
from solver.design import design
from solver.quality import evaluate
from solver.result import Design, Quality

JSON = dict[str, Any]
_READING = 0.02
_DESIGNING = 0.96


@dataclass(frozen=True, eq=False)
class DesignOutcome:
    """A design with what was made of it."""

    design: Design
    layout: Layout
    prepared: PreparedSubject
    summary: JSON


def run_design(
    scan_path: Path,
    spec: RigSpec,
    folder: Path,
    *,
    scan_name: str,
    workers: int,
    progress: ProgressCallback,
    cancel: CancelToken,
) -> DesignOutcome:
    """Read, design, lay out, write. ``folder`` exists and is empty."""
    progress(Progress("reading the scan", 0.0))
    prepared = prepare_subject(read_scan(scan_path, spec.scan_options), spec.subject_options)

    def within(inner: Progress, /) -> None:
        fraction = _READING + (_DESIGNING - _READING) * inner.fraction
        progress(
            Progress(
                inner.stage, fraction, inner.start, inner.iteration, inner.cost, inner.violation
            )
        )

    made = design(
        prepared.subject,
        spec.camera,
        spec.limits,
        count=spec.count,
        seed=spec.seed,
        starts=spec.starts,
        fixed=spec.fixed,
        start=spec.start or None,
        workers=workers,
        progress=within,
        cancel=cancel,
    )
    progress(Progress("writing the files", _DESIGNING))
    layout = make_layout(made.cameras, prepared.subject, spec.limits)
    write_design_folder(folder, made, layout, prepared, spec, scan_name)
    progress(Progress("done", 1.0))
    return DesignOutcome(made, layout, prepared, design_summary(made, layout, prepared, spec.name))


def run_evaluation(
    scan_path: Path, spec: RigSpec, cameras: tuple[RigCamera, ...]
) -> tuple[JSON, JSON]:
    """Score given cameras: the figures in short, and their document."""
    prepared = prepare_subject(read_scan(scan_path, spec.scan_options), spec.subject_options)
    quality = evaluate(prepared.subject, cameras, spec.limits)
    summary = quality_summary(quality, len(cameras), prepared)
    return summary, evaluation_document(cameras, quality)


def write_scan(scan: Scan, path: Path) -> None:
    """A scan as a mesh file, millimetres in the rig frame."""
    trimesh.Trimesh(
        scan.vertices_mm, scan.faces, vertex_normals=scan.normals, process=False
    ).export(path)


def quality_summary(quality: Quality, cameras: int, prepared: PreparedSubject) -> JSON:
    """The figures of a network in short, as JSON data."""
    summary: JSON = plain(
        {
            "feasible": quality.feasible,
            "cameras": cameras,
            "cost_mm2": quality.cost_mm2,
            "sigma_median_mm": quality.sigma_median_mm,
            "sigma_p95_mm": quality.sigma_p95_mm,
            "sigma_max_mm": quality.sigma_max_mm,
            "coverage": quality.coverage,
            "in_focus_share": quality.in_focus_share,
            "in_frame_share": quality.in_frame_share,
            "violated": [row.name for row in quality.violated],
            "notes": prepared.notes,
        }
    )
    return summary


def design_summary(made: Design, layout: Layout, prepared: PreparedSubject, name: str) -> JSON:
    """A design in short, as JSON data."""
    more: JSON = plain(
        {
            "name": name,
            "seed": made.solver.seed,
            "status": str(made.solver.status),
            "why_stopped": made.solver.why_stopped,
            "start_cost_mm2": made.start_quality.cost_mm2,
            "conflicts": made.solver.conflicts,
            "collisions": len(layout.collisions),
            "seconds": made.solver.seconds,
        }
    )
    return quality_summary(made.quality, len(made.cameras), prepared) | more
