"""``rigwright accept``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import (
    CaptureOption,
    ForceOption,
    JsonOption,
    OutOption,
    PicturesArgument,
    ReferenceOption,
    TargetsOption,
    WorkersOption,
)


def accept(
    pictures: PicturesArgument,
    reference: ReferenceOption,
    target_set: TargetsOption,
    out: OutOption,
    limit: Annotated[
        tuple[float, float, float],
        typer.Option(
            metavar="A K B",
            help="Largest error of a length L: A + K L, at most B (um, um per m, um).",
        ),
    ] = (20.0, 50.0, 50.0),
    volume: Annotated[
        tuple[float, float, float],
        typer.Option(metavar="W H D", help="The volume measured in, mm."),
    ] = (300.0, 300.0, 200.0),
    capture: CaptureOption = None,
    rig: Annotated[str, typer.Option(help="For the certificate.")] = "",
    operator: Annotated[str, typer.Option(help="For the certificate.")] = "",
    temperature: Annotated[
        float | None, typer.Option(help="Degrees Celsius.", show_default=False)
    ] = None,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Test a calibrated rig with a calibrated bar along seven lines, and write a certificate.

    In the style of VDI/VDE 2634 part 1 at the scale of a face; it claims no conformity.

    Exit code: 0 passed, 4 failed or incomplete, 2 bad input.

    Example:  rigwright accept bar-pictures --reference calibration --targets bar.toml --out test
    """
    options = Accepting(reference, target_set, limit, volume, rig, operator, temperature, workers)
    run_accept_command(pictures, capture, out, options, as_json=as_json, force=force)


@dataclass(frozen=True)
class Accepting:
    """What to test with, and against which limit."""

    reference: Path
    targets: Path
    limit: tuple[float, float, float]
    volume: tuple[float, float, float]
    rig: str
    operator: str
    temperature_degc: float | None
    workers: int | None


def run_accept_command(
    pictures: Path,
    captures: Sequence[str] | None,
    out: Path,
    options: Accepting,
    *,
    as_json: bool,
    force: bool,
) -> None:
    """Test, write the certificate into ``out``; the exit code tells whether it was passed."""
    from common.files.folders import new_folder
    from service.cli.output import NOT_WELL
    from service.cli.pictures import asked, given, reference_file, show_measured
    from service.cli.running import one_line_errors, run_task

    with one_line_errors():
        request, inputs = asked(pictures, captures, options.workers)
        request |= {
            "limit": options.limit,
            "volume": options.volume,
            "rig": options.rig,
            "operator": options.operator,
            "temperature_degc": options.temperature_degc,
        }
        inputs |= {"calibration": reference_file(options.reference), "targets": options.targets}
        with new_folder(out, force=force, spare=given(pictures, inputs)) as folder:
            result = run_task("service.tasks.calibrating:acceptance", request, inputs, folder)
        show_measured("acceptance", result, out, as_json=as_json)
    if result["outcome"] != "passed":
        raise typer.Exit(NOT_WELL)
