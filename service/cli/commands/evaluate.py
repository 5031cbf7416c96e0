"""``rigwright evaluate``."""

from __future__ import annotations

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
    import json
    import tempfile

    from rig.design.designfile import read_design
    from rig.design.designmodel import ConstraintFigures
    from rig.specification.rigfile import read_rig_file
    from service.cli.output import print_result_json
    from service.cli.running import one_line_errors, require_files, run_task
    from service.kinds.evaluation import EVALUATION, EvaluationRequest

    with one_line_errors(), tempfile.TemporaryDirectory(prefix="rigwright-") as temporary:
        require_files([design_file, scan, rig])
        rig_file = read_rig_file(rig)
        placed = read_design(design_file, rig_file.to_spec().camera).file
        request = EvaluationRequest(rig=rig_file, design=placed)
        folder = Path(temporary) / "files"
        folder.mkdir()
        result = run_task(EVALUATION, request, {"scan": scan}, folder)
        document = json.loads((folder / "evaluation.json").read_text(encoding="utf-8"))
        constraints = [ConstraintFigures.model_validate(row) for row in document["constraints"]]
        if as_json:
            rows = [row.model_dump(mode="json") for row in constraints]
            print_result_json(result, {}, constraints=rows)
            return
        from service.cli.tables import design_tables

        design_tables.print_notes(result)
        design_tables.print_figures(result)
        design_tables.print_limits(constraints)
