"""``rigwright reconstruct``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import (
    CaptureOption,
    ForceOption,
    JsonOption,
    OutOption,
    PicturesArgument,
    WorkersOption,
)


class MeshEnding(StrEnum):
    """How a surface is written."""

    PLY = "ply"
    GLB = "glb"
    OBJ = "obj"


def reconstruct(
    pictures: PicturesArgument,
    out: OutOption,
    calibration: Annotated[
        Path | None,
        typer.Option(
            metavar="CALIBRATION",
            help="What `rigwright calibrate` wrote: the folder or its calibration.json.",
            show_default=False,
        ),
    ] = None,
    design: Annotated[
        Path | None,
        typer.Option(
            metavar="DESIGN.json",
            help="Cameras as designed, where there is no calibration (simulated pictures).",
            show_default=False,
        ),
    ] = None,
    capture: CaptureOption = None,
    frame: Annotated[
        str | None,
        typer.Option(help="The instant, where the pictures show several.", show_default=False),
    ] = None,
    stride: Annotated[
        int, typer.Option(metavar="PX", min=1, max=16, help="Pixels between points.")
    ] = 2,
    cell: Annotated[
        float | None,
        typer.Option(
            metavar="MM",
            help="About the edge of the mesh's triangles; else by the points' spacing.",
            show_default=False,
        ),
    ] = None,
    mesh: Annotated[
        list[MeshEnding] | None,
        typer.Option(
            help="How to write the surface, ply and glb without it; can be given several times.",
            show_default=False,
        ),
    ] = None,
    depth_maps: Annotated[
        bool,
        typer.Option("--depth-maps", help="Write what each camera measured, as pictures of mm."),
    ] = False,
    texture: Annotated[
        bool,
        typer.Option("--texture", help="Put the pictures onto mesh.glb and mesh.obj."),
    ] = False,
    name: Annotated[str, typer.Option(help="What to call it.")] = "",
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Reconstruct the surface that the pictures of one capture show.

    Writes the points with normals, colours and sigmas (cloud.ply), the surface through them
    (mesh.ply, mesh.glb, mesh.obj) and a page with the surface to turn. Needs the extra
    'evaluation'.

    Exit code: 0 done, 2 bad input, 130 interrupted.

    Example:  rigwright reconstruct sessions/anna --calibration calibration --out face
    """
    from common.errors import InputError
    from common.files.folders import new_folder
    from common.files.ownership import files_of
    from common.files.strict import validated
    from service.cli.output import print_result_json
    from service.cli.pictures import picture_source, reference_file
    from service.cli.running import one_line_errors, run_task
    from service.cli.tables import evaluation_tables
    from service.cli.tables.design_tables import print_files
    from service.kinds.reconstruction import RECONSTRUCTION, ReconstructionRequest

    with one_line_errors():
        if calibration is None and design is None:
            raise InputError(
                "cameras-unknown",
                "where the cameras are is not known",
                "give --calibration, or --design for cameras that stand as designed",
            )
        source = picture_source(pictures, capture, workers)
        inputs = dict(source.inputs)
        if calibration is not None:
            inputs["calibration"] = reference_file(calibration)
        if design is not None:
            inputs["design"] = design
        asked = {
            "name": name, "frame": frame, "stride_px": stride, "cell_mm": cell,
            "meshes": mesh or (MeshEnding.PLY, MeshEnding.GLB), "depth_maps": depth_maps,
            "texture": texture,
        }  # fmt: skip
        request = validated(ReconstructionRequest, asked, "the reconstruction")
        with new_folder(out, force=force, spare=[pictures, *inputs.values()]) as folder:
            result = run_task(RECONSTRUCTION, request, inputs, folder, source.run)
        if as_json:
            print_result_json(result, files_of(out))
            return
        evaluation_tables.print_reconstruction(result)
        print_files(files_of(out))
