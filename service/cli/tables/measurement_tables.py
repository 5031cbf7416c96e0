"""Calibrations, checks and acceptance tests as tables on standard output."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from service.kinds.acceptance import AcceptanceResult
from service.kinds.calibration import CalibrationResult
from service.kinds.check import CheckOutcome
from service.kinds.detection import Detection
from service.kinds.targets import TargetsResult

_LIGHTS = {"green": "green", "yellow": "yellow", "red": "red"}


def _number(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _load(statistic: float | None, limit: float | None, verdict: str) -> str:
    """A test over its limit; a camera that is fine all the same has what was found to thank."""
    if statistic is None or not limit:
        return "-"
    if verdict == "fine" and statistic > limit:
        return "explained"
    return f"{statistic / limit:.2f}"


def _say(*lines: str) -> None:
    console = Console(highlight=False)
    for line in lines:
        console.print(line, markup=False)


def _print_detection(detection: Detection) -> None:
    rejected = sum(row.count for row in detection.rejected)
    rules = ", ".join(f"{row.count} {row.rule}" for row in detection.rejected)
    _say(
        f"{detection.targets} targets in {detection.pictures} pictures of "
        f"{len(detection.cameras)} cameras, {detection.frames} frames; "
        f"{rejected} not used{f' ({rules})' if rules else ''}"
    )


def print_targets(result: TargetsResult) -> None:
    """A target set, carrier by carrier."""
    table = Table("Carrier", "Kind", "Targets", title=escape(result.name), title_justify="left")
    for row in result.carriers:
        table.add_row(escape(row.name), row.kind, str(row.targets))
    Console().print(table)
    if result.cameras:
        seen = Table(
            *("Camera", "Sees targets", "In ninths of its picture", "Radius of dots px"),
            title="What each camera sees of the stand",
            title_justify="left",
        )
        for camera in result.cameras:
            low, high = camera.radius_px
            seen.add_row(
                escape(camera.camera),
                str(camera.targets),
                str(camera.cells),
                f"{_number(low, 1)} to {_number(high, 1)}",
            )
        Console().print(seen)
    _say(*(f"note: {note}" for note in result.notes))


def print_calibration(result: CalibrationResult) -> None:
    """A calibration: what it is worth, camera by camera."""
    _print_detection(result.detection)
    table = Table(
        *(
            "Camera",
            "Points",
            "rms px",
            "f px",
            "+-",
            "Position +- mm",
            "Rotation +- deg",
            "Filled",
        ),
        title="Cameras (sigmas are 1 sigma)",
        title_justify="left",
    )
    for row in result.cameras:
        table.add_row(
            escape(row.name),
            str(row.points),
            _number(row.rms_px),
            _number(row.focal_length_px, 1),
            _number(row.focal_sigma_px, 2),
            _number(row.position_sigma_mm),
            _number(row.rotation_sigma_deg, 4),
            f"{100.0 * row.coverage:.0f} %",
        )
    Console().print(table)
    cross = result.cross_validation
    _say(
        f"rms {_number(result.rms_px)} px, {result.rejected} points left out; "
        f"scale from {result.scale}"
        + ("" if cross is None else f"; two halves differ by {cross:.2f} of what is predicted")
    )
    if not result.converged:
        _say(f"warning: not converged ({result.why_stopped})")
    _say(*(f"warning: {text}" for text in result.warnings))


def print_check(result: CheckOutcome) -> None:
    """A check: the light, the findings, and each camera."""
    _print_detection(result.detection)
    light = result.light
    console = Console(highlight=False)
    console.print(f"[bold {_LIGHTS[light]}]{light.upper()}[/]  {escape(result.text)}")
    table = Table(
        *("Camera", "Verdict", "Test", "Effect mm", "Effect px", "Could hide mm"),
        title="Cameras (a test above 1 alarms, unless a finding explains it)",
        title_justify="left",
    )
    for row in result.cameras:
        table.add_row(
            escape(row.name),
            row.verdict.replace("-", " ") + (f" ({escape(row.reason)})" if row.reason else ""),
            _load(row.pose_statistic, row.pose_limit, row.verdict),
            _number(row.effect_mm),
            _number(row.effect_px),
            _number(row.hidden_mm),
        )
    Console().print(table)
    _say(*result.notes)


def print_acceptance(result: AcceptanceResult) -> None:
    """An acceptance test: the outcome, and each length."""
    _print_detection(result.detection)
    _say(result.text, *(f"missing: {text}" for text in result.missing))
    lines = {name: k for k, name in enumerate(dict.fromkeys(r.line for r in result.lengths), 1)}
    _say(*(f"line {k}: {name}" for name, k in lines.items()))
    table = Table(
        *("Line", "Length", "mm", "Error um", "Limit um", "State"),
        title="Lengths",
        title_justify="left",
    )
    for row in result.lengths:
        table.add_row(
            str(lines[row.line]),
            escape(f"{row.first} - {row.second}"),
            _number(row.calibrated_mm, 4),
            f"{row.error_um:+.1f}",
            _number(row.limit_um, 1),
            "within" if row.within else "BEYOND",
        )
    Console().print(table)
    _say(*result.notes)
