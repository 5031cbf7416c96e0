"""``rigwright calibrate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import (
    CaptureOption,
    ForceOption,
    JsonOption,
    OutOption,
    PicturesArgument,
    TargetsOption,
    WorkersOption,
)
from service.kinds.lens import LensChoice, LensParameter


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
    model: Annotated[
        LensChoice | None,
        typer.Option(
            help="How the lenses bend: brown (the usual), rational for wide ones, fisheye.",
            show_default=False,
        ),
    ] = None,
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

    Exit code: 0 done, 2 bad input, 4 do not use it (not converged, the pictures leave a focal
    length open, or another lens model fits better), 130 interrupted.

    Example:  rigwright calibrate pictures --targets targets/targets.toml --out calibration
    """
    import shutil

    from common.files.folders import new_folder
    from common.files.ownership import files_of
    from service.cli.output import NOT_WELL, print_result_json, say_next
    from service.cli.pictures import TARGETS, picture_source
    from service.cli.running import one_line_errors, run_task
    from service.cli.tables import measurement_tables
    from service.cli.tables.design_tables import print_files
    from service.kinds.calibration import CALIBRATION, CalibrationRequest, KnownPoses

    with one_line_errors():
        source = picture_source(pictures, capture, workers)
        known = None
        if poses_known_to is not None:
            sigma_mm, sigma_deg = poses_known_to
            known = KnownPoses(position_sigma_mm=sigma_mm, rotation_sigma_deg=sigma_deg)
        request = CalibrationRequest(
            name=name, model=model, hold=hold or [], free=free or [], poses_known_to=known
        )
        inputs = {**source.inputs, "targets": target_set}
        if design is not None:
            inputs["design"] = design
        with new_folder(out, force=force, spare=[pictures, *inputs.values()]) as folder:
            result = run_task(CALIBRATION, request, inputs, folder, source.run)
            # For later checks.
            shutil.copyfile(target_set, folder / TARGETS)
        if as_json:
            print_result_json(result, files_of(out))
        else:
            measurement_tables.print_calibration(result)
            print_files(files_of(out))
    if not result.converged or result.doubtful_lenses or result.unfit_lenses:
        raise typer.Exit(NOT_WELL)
    if not as_json:
        say_next(
            f"open {out / 'report.html'} in a browser, and check the rig before each day's work",
            *("check", "PICTURES", "--reference", out, "--out", "my-check"),
            *("--history", "my-checks"),
        )
