"""``rigwright evaluate``."""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import JsonOption, RigOption, ScanArgument


def evaluate(
    design_file: Annotated[
        Path,
        typer.Argument(metavar="DESIGN.json", help="The cameras to score.", show_default=False),
    ],
    scan: ScanArgument,
    rig: RigOption,
    as_json: JsonOption = False,
) -> None:
    """Score given cameras with the figures of a design. Writes no files.

    Of an existing rig, the keys "schema" and "cameras" of a design file are enough.

    Example:  rigwright evaluate rig/design.json head.glb --rig face.toml
    """
    run_evaluate_command(design_file, scan, rig, as_json=as_json)


def run_evaluate_command(design_file: Path, scan: Path, rig: Path, *, as_json: bool) -> None:
    """Score the cameras of ``design_file`` on ``scan`` against the limits of ``rig``."""
    from service.cli.running import one_line_errors, run_task

    inputs = {"scan": scan, "rig": rig, "design": design_file}
    with one_line_errors(), tempfile.TemporaryDirectory(prefix="rigwright-") as temporary:
        folder = Path(temporary) / "files"
        folder.mkdir()
        result = run_task("service.tasks.designing:evaluation_from_files", {}, inputs, folder)
        document = json.loads((folder / "evaluation.json").read_text(encoding="utf-8"))
        if as_json:
            shown = {"result": result, "constraints": document["constraints"]}
            sys.stdout.write(json.dumps(shown, indent=2) + "\n")
        else:
            from service.cli.tables import design_tables

            design_tables.print_notes(result)
            design_tables.print_figures(result)
            design_tables.print_limits(document["constraints"])
