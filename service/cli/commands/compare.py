"""``rigwright compare``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.cli.options import ForceOption, JsonOption, OutOption

if TYPE_CHECKING:
    from service.kinds.comparison import ComparisonRequest


def compare(
    cloud: Annotated[
        Path,
        typer.Argument(metavar="CLOUD.ply", help="The points, in millimetres.", show_default=False),
    ],
    truth: Annotated[
        Path,
        typer.Option(
            "--truth",
            metavar="MESH",
            help="The reference surface, in millimetres.",
            show_default=False,
        ),
    ],
    out: OutOption,
    align: Annotated[str, typer.Option(help="none, best-fit (rigid), or best-fit-scale.")] = "none",
    within: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(metavar="X Y Z RADIUS", help="Compare this ball only.", show_default=False),
    ] = None,
    limit: Annotated[
        float, typer.Option(metavar="MM", help="Points farther off are left out, and counted.")
    ] = 5.0,
    scale: Annotated[float, typer.Option(metavar="MM", help="End of the colour scale.")] = 0.2,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Compare a cloud with a reference surface: distances, completeness, figures, a page.

    Clouds may come from any program that writes PLY. Needs the extra 'evaluation'.

    Exit code: 0 done, 2 bad input, 130 interrupted.

    Example:  rigwright compare face/cloud.ply --truth head.ply --out compared
    """
    from common.files.folders import new_folder
    from common.files.ownership import files_of
    from service.cli.output import print_result_json
    from service.cli.running import one_line_errors, run_task
    from service.cli.tables import evaluation_tables
    from service.cli.tables.design_tables import print_files
    from service.kinds.comparison import COMPARISON

    with one_line_errors():
        request = _request(align, within, limit, scale)
        inputs = {"cloud": cloud, "reference": truth}
        with new_folder(out, force=force, spare=inputs.values()) as folder:
            result = run_task(COMPARISON, request, inputs, folder)
        if as_json:
            print_result_json(result, files_of(out))
            return
        evaluation_tables.print_comparison(result)
        print_files(files_of(out))


def _request(
    align: str, within: tuple[float, float, float, float] | None, limit: float, scale: float
) -> ComparisonRequest:
    from common.files.strict import validated
    from service.kinds.comparison import ComparisonRequest

    ball = None if within is None else {"centre_mm": within[:3], "radius_mm": within[3]}
    asked = {"align": align, "within": ball, "limit_mm": limit, "scale_mm": scale}
    return validated(ComparisonRequest, asked, "the comparison")
