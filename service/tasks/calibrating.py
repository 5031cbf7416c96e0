"""Calibrations, checks and acceptance tests, asked for over HTTP or on the command line.

What all have: the target set as input ``targets``, the pictures as in
:mod:`service.measuring.seeing`, ``workers`` and ``made_utc`` in the request.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calibration.acceptance import LengthLimit, Volume, accept, certificate_pdf
from calibration.acceptance.certificate import Heading
from calibration.adjustment import CalibratedCamera, CalibrationOptions, ReferencePoses, calibrate
from calibration.adjustment.options import FIXED, FREE, InteriorModel
from calibration.check import CheckOptions, check
from calibration.files import (
    ACCEPTANCES,
    CHECKS,
    AcceptanceRecord,
    CalibrationRecord,
    CheckRecord,
    read_calibration,
    write_calibration,
)
from calibration.report import calibration_page, check_page, history_of, history_page
from calibration.targets.files import read_targets
from common.errors import InputError
from common.progress import CancelToken, Progress, ProgressCallback
from rig.design.designfile import read_design
from service.measuring.figures import acceptance_figures, calibration_figures, check_figures
from service.measuring.seeing import DETECTING, see, seen_figures

JSON = dict[str, Any]
Request = Mapping[str, Any]
Inputs = Mapping[str, Path]


def calibration(
    request: Request, inputs: Inputs, folder: Path, report: ProgressCallback, cancel: CancelToken
) -> JSON:
    """Calibrate all cameras; writes ``calibration.json``, ``report.html``, ``detections.json``."""
    plan = read_targets(inputs["targets"])
    seen = see(plan, request, inputs, folder, report, cancel)
    options = _options(request, inputs)
    done = calibrate(seen.observations, options, _after(report), cancel)
    record = CalibrationRecord(request["name"], request["made_utc"], done)
    write_calibration(folder / "calibration.json", record)
    _write(folder / "report.html", calibration_page(record))
    report(Progress("done", 1.0))
    return {"detection": seen_figures(seen), **calibration_figures(done)}


def _options(request: Request, inputs: Inputs) -> CalibrationOptions:
    start: tuple[CalibratedCamera, ...] = ()
    if "design" in inputs:
        start = tuple(map(CalibratedCamera.from_rig, read_design(inputs["design"]).cameras))
    sigmas = request.get("poses_known_to")
    hold, free = request.get("hold") or (), request.get("free") or ()
    both = sorted(set(hold) & set(free))
    if both:
        raise InputError(
            "calibration-model",
            f"the lens parameter {both[0]} shall be held and free",
            "name it in one of the two",
        )
    model = dict.fromkeys(hold, FIXED) | dict.fromkeys(free, FREE)
    return CalibrationOptions(
        start=start,
        model=InteriorModel(**model),
        reference_poses=None if sigmas is None else ReferencePoses(*sigmas),
        cross_validate=request.get("cross_validate", True),
    )


def rig_check(
    request: Request, inputs: Inputs, folder: Path, report: ProgressCallback, cancel: CancelToken
) -> JSON:
    """Check a rig against its calibration; writes ``check.json``, ``report.html``.

    With earlier checks (inputs ``check-0``, ``check-1``...) there is a ``history.html`` as well.
    """
    told = read_calibration(inputs["calibration"])
    reference, name = told.calibration, _name(request, inputs, told)
    seen = see(read_targets(inputs["targets"]), request, inputs, folder, report, cancel)
    given = {k: request.get(k) for k in ("hidden_limit_mm", "tolerance_mm")}
    limits = {key: value for key, value in given.items() if value is not None}
    result = check(reference, seen.observations, CheckOptions(**limits), _after(report), cancel)
    record = CheckRecord(name, request["made_utc"], result)
    CHECKS.write(folder / "check.json", record)
    _write(folder / "report.html", check_page(record, reference))
    earlier = [CHECKS.read(path) for role, path in inputs.items() if role.startswith("check-")]
    if earlier:
        history = history_of([*earlier, record], name)
        _write(folder / "history.html", history_page(history))
    report(Progress("done", 1.0))
    return {"detection": seen_figures(seen), **check_figures(result)}


def acceptance(
    request: Request, inputs: Inputs, folder: Path, report: ProgressCallback, cancel: CancelToken
) -> JSON:
    """Measure a calibrated bar along several lines; writes ``certificate.pdf``."""
    told = read_calibration(inputs["calibration"])
    reference, name = told.calibration, _name(request, inputs, told)
    limit, volume = LengthLimit(*request["limit"]), Volume(*request["volume"])
    seen = see(read_targets(inputs["targets"]), request, inputs, folder, report, cancel)
    done = accept(reference, seen.observations, limit, volume, _after(report), cancel)
    heading = Heading(
        rig=request["rig"],
        calibration=name,
        artefact=seen.observations.targets.name,
        operator=request["operator"],
        made_utc=request["made_utc"],
        temperature_degc=request["temperature_degc"],
    )
    (folder / "certificate.pdf").write_bytes(certificate_pdf(done, heading))
    record = AcceptanceRecord(name, request["made_utc"], done)
    ACCEPTANCES.write(folder / "acceptance.json", record)
    report(Progress("done", 1.0))
    return {"detection": seen_figures(seen), **acceptance_figures(done)}


def _name(request: Request, inputs: Inputs, record: CalibrationRecord) -> str:
    """What a reference is called: its id, or its name and time, which tell it from others."""
    known = request.get("reference")
    if known:
        return str(known)
    return f"{record.name or inputs['calibration'].parent.name}, {record.made_utc}"


def _after(report: ProgressCallback) -> ProgressCallback:
    """Progress of what follows detection."""

    def within(inner: Progress, /) -> None:
        report(Progress(inner.stage, DETECTING + (0.99 - DETECTING) * inner.fraction))

    return within


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
