"""Designs and evaluations."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import trimesh

from common.progress import Progress, within
from geometry.head import synthetic_head
from geometry.preparation import PreparedSubject, prepare_subject
from geometry.reading import read_scan
from geometry.scan import Scan
from rig.acquisition.station.examples import example_station_text
from rig.design.designfile import design_from_mapping, evaluation_document
from rig.design.layout import Layout, make_layout
from rig.report.designfolder import write_design_folder
from rig.specification.examples import example_text
from rig.specification.rigfile import parse_rig
from rig.specification.solving import solved
from rig.specification.spec import RigSpec
from service.jobs.engine import Running, Task
from service.kinds.base import Note
from service.kinds.design import Conflict, DemoRequest, DesignBound, DesignRequest, DesignResult
from service.kinds.evaluation import Coverage, EvaluationRequest, EvaluationResult
from service.tasks.reading import notes_of
from solver.quality import evaluate
from solver.result import Design, Quality
from solver.standing import check_places
from solver.workers import Workers

_READING = 0.02
_DESIGNING = 0.96


def design(task: Task[DesignRequest, DesignResult], running: Running) -> DesignResult:
    """Design a rig for the input ``scan`` and write its files."""
    spec = task.request.spec()
    return _designed(
        task.inputs["scan"], spec, task.folder, task.run.scan_name, task.run.workers, running
    )


def demo(task: Task[DemoRequest, DesignResult], running: Running) -> DesignResult:
    """Design the example face rig for the bundled head; both are put beside the design."""
    running.report(Progress("making the head", 0.0))
    scan = task.folder.with_name("head.ply")
    write_scan(synthetic_head(), scan)
    rig = example_text("face")
    spec = parse_rig(rig, "face.toml")
    result = _designed(scan, spec, task.folder, scan.name, task.run.workers, running)
    scan.replace(task.folder / scan.name)
    (task.folder / "face.toml").write_text(rig, encoding="utf-8")
    (task.folder / "station.toml").write_text(example_station_text(), encoding="utf-8")
    return result


def evaluation(
    task: Task[EvaluationRequest, EvaluationResult], running: Running
) -> EvaluationResult:
    """Score given cameras on the input ``scan`` and write ``evaluation.json``."""
    spec = task.request.rig.to_spec()
    placed = task.request.design.model_dump(by_alias=True, exclude_unset=True)
    cameras = design_from_mapping(placed, "design", spec.camera).cameras
    running.report(Progress("reading the scan and scoring", 0.0))
    scan = read_scan(task.inputs["scan"], spec.scan_options)
    prepared = prepare_subject(scan, spec.subject_options)
    check_places(prepared.subject, cameras, spec.limits)
    quality = evaluate(prepared.subject, cameras, spec.limits)
    document = json.dumps(evaluation_document(cameras, quality))
    (task.folder / "evaluation.json").write_text(document, encoding="utf-8")
    return _scored(quality, [c.name for c in cameras], prepared)


def _designed(
    scan: Path, spec: RigSpec, folder: Path, scan_name: str, workers: int, running: Running
) -> DesignResult:
    """Read, design, lay out, write."""
    running.report(Progress("reading the scan", 0.0))
    with Workers(workers) as helpers:
        if spec.count:
            helpers.begin()
        prepared = prepare_subject(read_scan(scan, spec.scan_options), spec.subject_options)
        made = solved(
            prepared.subject,
            spec,
            workers=helpers,
            bound=True,
            progress=within(running.report, _READING, _DESIGNING),
            cancel=running.cancel,
        )
    running.report(Progress("writing the files", _DESIGNING))
    layout = make_layout(made.cameras, prepared.subject, spec.limits)
    write_design_folder(folder, made, layout, prepared, spec, scan_name)
    running.report(Progress("done", 1.0))
    return _result(made, layout, prepared, spec)


def write_scan(scan: Scan, path: Path) -> None:
    """A scan as a mesh file, millimetres in the rig frame."""
    trimesh.Trimesh(
        scan.vertices_mm, scan.faces, vertex_normals=scan.normals, process=False
    ).export(path)


def _scored(quality: Quality, names: list[str], prepared: PreparedSubject) -> EvaluationResult:
    """The figures of a network in short."""
    return EvaluationResult(
        feasible=bool(quality.feasible),
        cameras=len(names),
        cost_mm2=float(quality.cost_mm2),
        sigma_median_mm=float(quality.sigma_median_mm),
        sigma_p95_mm=float(quality.sigma_p95_mm),
        sigma_max_mm=float(quality.sigma_max_mm),
        coverage=[Coverage(views=row.views, share=float(row.share)) for row in quality.coverage],
        in_focus_share=float(quality.in_focus_share),
        in_frame_share=float(quality.in_frame_share),
        matchable_share=quality.matchable.share(1),
        groups=[[names[k] for k in group] for group in quality.matchable.groups],
        violated=[row.name for row in quality.violated],
        notes=notes_of(prepared.notes),
    )


def _result(made: Design, layout: Layout, prepared: PreparedSubject, spec: RigSpec) -> DesignResult:
    """A design in short."""
    scored = _scored(made.quality, [c.name for c in made.cameras], prepared)
    bound = made.solver.bound
    conflicts = [
        Conflict(family=c.family, unit=c.unit, give=c.amount, give_alone=c.amount_alone)
        for c in made.solver.conflicts
    ]
    if made.solver.starts_note:
        scored.notes.append(Note(kind="warning", text=made.solver.starts_note))
    return DesignResult(
        **dict(scored),
        name=spec.name,
        seed=made.solver.seed,
        status=str(made.solver.status),
        why_stopped=made.solver.why_stopped,
        start_cost_mm2=float(made.start_quality.cost_mm2),
        conflicts=conflicts,
        contradiction=made.solver.contradiction,
        bound=None if bound is None else DesignBound(**asdict(bound), gap_share=bound.gap_share),
        collisions=len(layout.collisions),
        seconds=made.solver.seconds,
        placed=spec.count,
    )
