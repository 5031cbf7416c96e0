"""``rigwright targets``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import ForceOption, JsonOption
from service.kinds.defaults import PAGE


def targets(
    target_set: Annotated[
        Path | None,
        typer.Argument(metavar="[SET.toml]", help="Targets to print.", show_default=False),
    ] = None,
    design: Annotated[
        Path | None,
        typer.Option(
            metavar="DESIGN.json", help="Propose targets for this rig.", show_default=False
        ),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder to write into.")] = Path(
        "targets"
    ),
    page: Annotated[str, typer.Option(help="A4, A3, letter, or WIDTHxHEIGHT in mm.")] = PAGE,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Print targets at true size, or propose some for a rig.

    Writes the set (targets.toml), a PDF and an SVG per sheet with a check ruler, and a picture per
    carrier for the simulated studio. Measure the ruler on the paper and put its length into the
    set.

    Example:  rigwright targets --design rig/design.json --out targets
    """
    from common.errors import InputError
    from common.files.folders import new_folder
    from common.files.ownership import files_of
    from service.cli.output import print_result_json
    from service.cli.running import one_line_errors, run_task
    from service.cli.tables import measurement_tables
    from service.cli.tables.design_tables import print_files
    from service.kinds.targets import TARGETS, TargetsRequest

    with one_line_errors():
        given = {"targets": target_set, "design": design}
        inputs = {role: path for role, path in given.items() if path is not None}
        if len(inputs) != 1:
            raise InputError(
                "targets-which",
                "give a target set to print, or a design to propose one for",
                "for example: rigwright targets --design rig/design.json --out targets",
            )
        # A set that was printed before is printed anew, with its ruler measured: it is kept.
        renewed = [path for path in inputs.values() if path == out / "targets.toml"]
        spare = [path for path in inputs.values() if path not in renewed]
        with new_folder(out, force=force, spare=spare, renewed=renewed) as folder:
            result = run_task(TARGETS, TargetsRequest(page=page), inputs, folder)
        if as_json:
            print_result_json(result, files_of(out))
            return
        measurement_tables.print_targets(result)
        print_files(files_of(out))
