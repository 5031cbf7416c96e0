"""``rigwright calibrate``."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import (
    CaptureOption,
    ForceOption,
    JsonOption,
    LensParameter,
    OutOption,
    PicturesArgument,
    TargetsOption,
    WorkersOption,
)


def calibrate(
    pictures: PicturesArgument,
    target_set: TargetsOption,
    out: OutOption,
    design: Annotated[
        Path | None,
        typer.Option(
            metavar="DESIGN.json",
            help="The rig as designed, to start from; from nothing without it.",
            show_default=False,
        ),
    ] = None,
    capture: CaptureOption = None,
    hold: Annotated[
        list[LensParameter] | None,
        typer.Option(help="A lens parameter to leave as it is.", show_default=False),
    ] = None,
    free: Annotated[
        list[LensParameter] | None,
        typer.Option(help="A lens parameter to take without a prior.", show_default=False),
    ] = None,
    poses_known_to: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="MM DEG",
            help="The design's poses give the frame; they are known this well.",
            show_default=False,
        ),
    ] = None,
    name: Annotated[str, typer.Option(help="What to call it.")] = "",
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Calibrate all cameras of a rig from pictures of targets.

    Exit code: 0 done, 2 bad input, 130 interrupted.

    Example:  rigwright calibrate pictures --targets targets/targets.toml --out calibration
    """
    options = Calibrating(
        design, tuple(hold or ()), tuple(free or ()), poses_known_to, name, workers
    )
    run_calibrate_command(pictures, capture, target_set, out, options, as_json=as_json, force=force)


@dataclass(frozen=True)
class Calibrating:
    """How to calibrate."""

    design: Path | None
    hold: tuple[str, ...]
    free: tuple[str, ...]
    poses_known_to: tuple[float, float] | None
    name: str
    workers: int | None


def run_calibrate_command(
    pictures: Path,
    captures: Sequence[str] | None,
    targets: Path,
    out: Path,
    options: Calibrating,
    *,
    as_json: bool,
    force: bool,
) -> None:
    """Calibrate and write into ``out``, with a copy of the target set for later checks."""
    from common.files.folders import new_folder
    from service.cli.pictures import TARGETS, asked, given, show_measured
    from service.cli.running import one_line_errors, run_task

    with one_line_errors():
        request, inputs = asked(pictures, captures, options.workers)
        request |= {"name": options.name, "hold": options.hold, "free": options.free}
        request |= {"poses_known_to": options.poses_known_to}
        inputs |= {"targets": targets}
        if options.design is not None:
            inputs["design"] = options.design
        with new_folder(out, force=force, spare=given(pictures, inputs)) as folder:
            result = run_task("service.tasks.calibrating:calibration", request, inputs, folder)
            shutil.copyfile(targets, folder / TARGETS)
        show_measured("calibration", result, out, as_json=as_json)
