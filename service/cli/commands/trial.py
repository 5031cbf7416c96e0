"""``rigwright trial``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import ForceOption, JsonOption, OutOption, WorkersOption


def trial(
    design: Annotated[
        Path, typer.Argument(metavar="DESIGN.json", help="The design.", show_default=False)
    ],
    out: OutOption,
    head: Annotated[
        Path | None,
        typer.Option(metavar="HEAD", help="The head; else that of the design.", show_default=False),
    ] = None,
    texture: Annotated[
        Path | None,
        typer.Option(
            metavar="PICTURE", help="Its colours, where HEAD has none.", show_default=False
        ),
    ] = None,
    displacement: Annotated[
        Path | None,
        typer.Option(
            metavar="PICTURE", help="Its fine relief, a grey picture.", show_default=False
        ),
    ] = None,
    flip_texture: Annotated[
        bool, typer.Option("--flip-texture", help="Those pictures stand upside down.")
    ] = False,
    subdivisions: Annotated[
        int, typer.Option(min=0, max=3, help="How often the head's mesh is rounded.")
    ] = 1,
    exposure: Annotated[str, typer.Option(help="dark, right or over.")] = "right",
    radius: Annotated[
        float, typer.Option(metavar="MM", help="Judge what lies this near to the nose's tip.")
    ] = 95.0,
    stride: Annotated[
        int, typer.Option(metavar="PX", min=1, max=16, help="Pixels between points.")
    ] = 2,
    limit_rms: Annotated[
        float, typer.Option(metavar="MM", help="Largest rms of a rig that measures the face.")
    ] = 0.1,
    least_reached: Annotated[
        float, typer.Option(metavar="PERCENT", help="Least share that has a point within 0.5 mm.")
    ] = 90.0,
    blender: Annotated[
        str | None,
        typer.Option(
            metavar="PROGRAM",
            help="Photograph with Blender, or with a Python that has its module bpy.",
            show_default=False,
        ),
    ] = None,
    samples: Annotated[
        int, typer.Option(min=1, max=4096, help="Rays for each pixel, with --blender.")
    ] = 64,
    name: Annotated[str, typer.Option(help="What to call it.")] = "",
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Try a design on a head: photograph it, reconstruct it, compare it with the truth.

    All in the computer: simulated cameras at their designed places, the matcher that real captures
    get, the surface that was photographed as the reference. Needs the extra 'evaluation'.

    Exit code: 0 it measures the face, 4 it does not, 2 bad input, 130 interrupted.

    Example:  rigwright trial my-rig/design.json --head head.glb --out my-trial
    """
    from common.files.folders import new_folder
    from common.files.ownership import files_of
    from common.files.strict import validated
    from service.cli.output import NOT_WELL, print_result_json
    from service.cli.running import one_line_errors, processes, run_task
    from service.cli.scans import scan_of
    from service.cli.tables import evaluation_tables
    from service.cli.tables.design_tables import print_files
    from service.kinds.base import RunContext
    from service.kinds.trial import TRIAL, TrialRequest

    with one_line_errors():
        asked = {
            "name": name, "exposure": exposure, "radius_mm": radius, "stride_px": stride,
            "limit_rms_mm": limit_rms, "least_reached_percent": least_reached,
            "flip_texture": flip_texture, "subdivisions": subdivisions, "samples": samples,
        }  # fmt: skip
        request = validated(TrialRequest, asked, "the trial")
        inputs = {"design": design, "head": head or scan_of(design)}
        more = {"texture": texture, "displacement": displacement}
        inputs |= {role: path for role, path in more.items() if path is not None}
        run = RunContext(workers=processes(workers), blender=blender)
        with new_folder(out, force=force, spare=inputs.values()) as folder:
            result = run_task(TRIAL, request, inputs, folder, run)
        if as_json:
            print_result_json(result, files_of(out))
        else:
            evaluation_tables.print_trial(result)
            print_files(files_of(out))
    if not result.measures:
        raise typer.Exit(NOT_WELL)
