"""Designs and evaluations, asked for over HTTP or on the command line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from common.progress import CancelToken, Progress, ProgressCallback
from geometry.camera import RigCamera
from geometry.head import synthetic_head
from rig.acquisition.station.examples import example_station_text
from rig.design.designfile import design_from_mapping, read_design
from rig.specification.examples import example_text
from rig.specification.rigfile import parse_rig, read_rig, rig_from_mapping
from rig.specification.spec import RigSpec
from service import work

JSON = dict[str, Any]
Request = Mapping[str, Any]
Inputs = Mapping[str, Path]


def design(
    request: Request, inputs: Inputs, folder: Path, report: ProgressCallback, cancel: CancelToken
) -> JSON:
    """Design a rig given as JSON and write its files into ``folder``."""
    spec = rig_from_mapping(request["rig"])
    return _designed(request, inputs["scan"], spec, folder, report, cancel)


def design_from_files(
    request: Request, inputs: Inputs, folder: Path, report: ProgressCallback, cancel: CancelToken
) -> JSON:
    """Design a rig given as a file, with what the command line says instead of it."""
    spec = _overridden(read_rig(inputs["rig"]), request)
    return _designed(request, inputs["scan"], spec, folder, report, cancel)


def demo(
    request: Request, inputs: Inputs, folder: Path, report: ProgressCallback, cancel: CancelToken
) -> JSON:
    """Design the example face rig for the bundled head; both are put beside the design."""
    del inputs
    report(Progress("making the head", 0.0))
    scan = folder.with_name("head.ply")
    work.write_scan(synthetic_head(), scan)
    rig = example_text("face")
    spec = _overridden(parse_rig(rig, "face.toml"), request)
    named = {**request, "scan_name": scan.name}
    summary = _designed(named, scan, spec, folder, report, cancel)
    scan.replace(folder / scan.name)
    (folder / "face.toml").write_text(rig, encoding="utf-8")
    (folder / "station.toml").write_text(example_station_text(), encoding="utf-8")
    return summary


def evaluation(
    request: Request, inputs: Inputs, folder: Path, report: ProgressCallback, cancel: CancelToken
) -> JSON:
    """Score cameras given as JSON and write ``evaluation.json`` into ``folder``."""
    del cancel
    spec = rig_from_mapping(request["rig"])
    cameras = design_from_mapping(request["design"], "design", spec.camera).cameras
    return _evaluated(inputs["scan"], spec, cameras, folder, report)


def evaluation_from_files(
    request: Request, inputs: Inputs, folder: Path, report: ProgressCallback, cancel: CancelToken
) -> JSON:
    """Score the cameras of a design file."""
    del request, cancel
    spec = read_rig(inputs["rig"])
    cameras = read_design(inputs["design"], spec.camera).cameras
    return _evaluated(inputs["scan"], spec, cameras, folder, report)


def _overridden(spec: RigSpec, request: Request) -> RigSpec:
    if request["cameras"] is not None:
        spec = spec.with_count(request["cameras"])
    if request["seed"] is not None:
        spec = spec.with_seed(request["seed"])
    if request["starts"] is not None:
        spec = replace(spec, starts=request["starts"])
    return spec


def _designed(
    request: Request,
    scan: Path,
    spec: RigSpec,
    folder: Path,
    report: ProgressCallback,
    cancel: CancelToken,
) -> JSON:
    outcome = work.run_design(
        scan,
        spec,
        folder,
        scan_name=request["scan_name"],
        workers=request["workers"],
        progress=report,
        cancel=cancel,
    )
    return outcome.summary


def _evaluated(
    scan: Path,
    spec: RigSpec,
    cameras: tuple[RigCamera, ...],
    folder: Path,
    report: ProgressCallback,
) -> JSON:
    report(Progress("reading the scan and scoring", 0.0))
    summary, document = work.run_evaluation(scan, spec, cameras)
    (folder / "evaluation.json").write_text(json.dumps(document), encoding="utf-8")
    return summary
