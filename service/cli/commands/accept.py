"""``rigwright accept``."""

from __future__ import annotations

from typing import Annotated

import typer

from calibration.defaults import LENGTH_LIMIT, VOLUME_MM
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
    ] = LENGTH_LIMIT,
    volume: Annotated[
        tuple[float, float, float],
        typer.Option(metavar="W H D", help="The volume measured in, mm."),
    ] = VOLUME_MM,
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
    from common.files.folders import new_folder
    from common.files.ownership import files_of
    from service.cli.output import NOT_WELL, print_result_json
    from service.cli.pictures import picture_source, reference_file
    from service.cli.running import one_line_errors, run_task
    from service.cli.tables import measurement_tables
    from service.cli.tables.design_tables import print_files
    from service.kinds.acceptance import ACCEPTANCE, AcceptanceRequest, Limit, MeasuredVolume

    with one_line_errors():
        source = picture_source(pictures, capture, workers)
        (a_um, k_um_per_m, b_um), (width_mm, height_mm, depth_mm) = limit, volume
        request = AcceptanceRequest(
            limit=Limit(a_um=a_um, k_um_per_m=k_um_per_m, b_um=b_um),
            volume=MeasuredVolume(width_mm=width_mm, height_mm=height_mm, depth_mm=depth_mm),
            rig=rig,
            operator=operator,
            temperature_degc=temperature,
        )
        calibration = reference_file(reference)
        inputs = {**source.inputs, "calibration": calibration, "targets": target_set}
        with new_folder(out, force=force, spare=[pictures, *inputs.values()]) as folder:
            result = run_task(ACCEPTANCE, request, inputs, folder, source.run)
        if as_json:
            print_result_json(result, files_of(out))
        else:
            measurement_tables.print_acceptance(result)
            print_files(files_of(out))
    if result.outcome != "passed":
        raise typer.Exit(NOT_WELL)
