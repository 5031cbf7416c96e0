"""``rigwright evaluate``."""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

from service.cli.running import one_line_errors, run_task


def run_evaluate_command(design_file: Path, scan: Path, rig: Path, *, as_json: bool) -> None:
    """Score the cameras of ``design_file`` on ``scan`` against the limits of ``rig``."""
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
            from service.cli import tables

            tables.print_notes(result)
            tables.print_figures(result)
            tables.print_limits(document["constraints"])
