"""Calibrations, checks and acceptance tests.

What all have: the target set as input ``targets``, the pictures as in
:mod:`service.tasks.seeing`, ``workers`` and ``made_utc`` in the task's run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from calibration.acceptance import LengthLimit, Volume, accept, certificate_pdf
from calibration.acceptance.certificate import Heading
from calibration.adjustment import CalibratedCamera, CalibrationOptions, ReferencePoses, calibrate
from calibration.adjustment.options import FIXED, FREE, InteriorModel
from calibration.check import CheckOptions, check
from calibration.detection.unseen import LeaveOut
from calibration.files import (
    ACCEPTANCES,
    CHECKS,
    AcceptanceRecord,
    CalibrationRecord,
    CheckRecord,
    read_calibration,
    write_calibration,
)
from calibration.report import (
    DetectionView,
    calibration_page,
    check_page,
    detection_views,
    history_of,
    history_page,
)
from calibration.targets.files import read_targets
from common.progress import Progress, ProgressCallback, within
from geometry.camera import LensModel
from rig.design.designfile import read_design
from service.jobs.engine import Running, Task
from service.kinds.acceptance import AcceptanceRequest, AcceptanceResult
from service.kinds.base import RunContext
from service.kinds.calibration import CalibrationRequest, CalibrationResult
from service.kinds.check import CheckOutcome, CheckRequest
from service.tasks.measurement_results import acceptance_result, calibration_result, check_result
from service.tasks.seeing import DETECTING, detection_of, see


def calibration(
    task: Task[CalibrationRequest, CalibrationResult], running: Running
) -> CalibrationResult:
    """Calibrate all cameras; writes ``calibration.json``, ``report.html``, ``detections.json``."""
    plan = read_targets(task.inputs["targets"])
    views: list[DetectionView] = []
    seen = see(
        plan,
        task,
        running,
        lambda found: views.extend(detection_views(found)),
        LeaveOut.MIRRORED,
    )
    options = options_of(task.request, task.inputs)
    done = calibrate(seen.observations, options, _after(running.report), running.cancel)
    warnings = (*seen.left_out, *seen.thrown_out(), *done.quality.warnings)
    done = replace(done, quality=replace(done.quality, warnings=warnings))
    record = CalibrationRecord(task.request.name, task.run.made_utc, done)
    write_calibration(task.folder / "calibration.json", record)
    _write(task.folder / "report.html", calibration_page(record, views))
    running.report(Progress("done", 1.0))
    return calibration_result(done, detection_of(seen))


def options_of(request: CalibrationRequest, inputs: Mapping[str, Path]) -> CalibrationOptions:
    """What a request and its design ask of the adjustment."""
    start: tuple[CalibratedCamera, ...] = ()
    if "design" in inputs:
        start = tuple(map(CalibratedCamera.from_rig, read_design(inputs["design"]).cameras))
    known = request.poses_known_to
    model = {str(name): FIXED for name in request.hold}
    model |= {str(name): FREE for name in request.free}
    return CalibrationOptions(
        start=start,
        model=InteriorModel(**model),
        reference_poses=None
        if known is None
        else ReferencePoses(known.position_sigma_mm, known.rotation_sigma_deg),
        cross_validate=request.cross_validate,
        lens=None if request.model is None else LensModel[request.model.name.upper()],
    )


def rig_check(task: Task[CheckRequest, CheckOutcome], running: Running) -> CheckOutcome:
    """Compare a rig with its calibration; writes ``check.json`` and ``report.html``.

    With earlier checks as inputs ``check-1``, ``check-2`` ... writes ``history.html`` as well.
    """
    told = read_calibration(task.inputs["calibration"])
    reference, name = told.calibration, _name(task.run, task.inputs, told)
    plan = read_targets(task.inputs["targets"])
    seen = see(plan, task, running, leave_out=LeaveOut.ALL)
    options = CheckOptions(
        hidden_limit_mm=task.request.hidden_limit_mm, tolerance_mm=task.request.tolerance_mm
    )
    report, cancel = _after(running.report), running.cancel
    result = check(reference, seen.observations, options, report, cancel, seen.problems)
    record = CheckRecord(name, task.run.made_utc, result)
    CHECKS.write(task.folder / "check.json", record)
    earlier = [CHECKS.read(path) for role, path in task.inputs.items() if role.startswith("check-")]
    beside = "history.html" if earlier else ""
    _write(task.folder / "report.html", check_page(record, reference, beside))
    if earlier:
        history = history_of([*earlier, record], name)
        _write(task.folder / beside, history_page(history))
    running.report(Progress("done", 1.0))
    return check_result(result, detection_of(seen))


def acceptance(
    task: Task[AcceptanceRequest, AcceptanceResult], running: Running
) -> AcceptanceResult:
    """Measure a calibrated bar along several lines; writes ``certificate.pdf``."""
    told = read_calibration(task.inputs["calibration"])
    reference, name = told.calibration, _name(task.run, task.inputs, told)
    request = task.request
    limit = LengthLimit(request.limit.a_um, request.limit.k_um_per_m, request.limit.b_um)
    asked = request.volume
    volume = Volume(asked.width_mm, asked.height_mm, asked.depth_mm)
    seen = see(read_targets(task.inputs["targets"]), task, running)
    report, cancel = _after(running.report), running.cancel
    done = accept(reference, seen.observations, limit, volume, report, cancel)
    heading = Heading(
        rig=request.rig,
        calibration=name,
        artefact=seen.observations.targets.name,
        operator=request.operator,
        made_utc=task.run.made_utc,
        temperature_degc=request.temperature_degc,
    )
    (task.folder / "certificate.pdf").write_bytes(certificate_pdf(done, heading))
    record = AcceptanceRecord(name, task.run.made_utc, done)
    ACCEPTANCES.write(task.folder / "acceptance.json", record)
    running.report(Progress("done", 1.0))
    return acceptance_result(done, detection_of(seen))


def _name(run: RunContext, inputs: Mapping[str, Path], record: CalibrationRecord) -> str:
    """What a reference is called: its id, or its name and time, which tell it from others."""
    if run.reference:
        return run.reference
    return f"{record.name or inputs['calibration'].parent.name}, {record.made_utc}"


def _after(report: ProgressCallback) -> ProgressCallback:
    """Progress of what follows detection."""
    return within(report, DETECTING, 0.99)


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
