"""``rigwright design`` and ``rigwright demo``."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import typer

from service.cli.running import new_folder, one_line_errors, run_task
from service.problems import EXIT_INFEASIBLE

JSON = dict[str, Any]


@dataclass(frozen=True)
class Overrides:
    """What the command line says instead of the rig file; None leaves it."""

    cameras: int | None = None
    seed: int | None = None
    starts: int | None = None
    workers: int | None = None

    def request(self) -> JSON:
        """As the work understands it."""
        return asdict(self) | {"workers": self.workers or os.cpu_count() or 1}


def run_design_command(
    scan: Path, rig: Path, out: Path, overrides: Overrides, *, as_json: bool, force: bool
) -> None:
    """Design for ``scan`` and write into ``out``."""
    request = overrides.request() | {"scan_name": scan.name}
    inputs = {"scan": scan, "rig": rig}
    _design(
        "service.tasks.designing:design_from_files",
        request,
        inputs,
        out,
        as_json=as_json,
        force=force,
    )


def run_demo_command(out: Path, workers: int | None, *, as_json: bool, force: bool) -> None:
    """Design the example rig for the bundled head."""
    request = Overrides(workers=workers).request()
    _design("service.tasks.designing:demo", request, {}, out, as_json=as_json, force=force)


def _design(
    entry: str, request: JSON, inputs: dict[str, Path], out: Path, *, as_json: bool, force: bool
) -> None:
    with one_line_errors():
        with new_folder(out, force=force, spare=inputs.values()) as folder:
            result = run_task(entry, request, inputs, folder)
        files = {path.name: path for path in sorted(out.iterdir())}
        _show(result, files, as_json=as_json)
    if not result["feasible"]:
        raise typer.Exit(EXIT_INFEASIBLE)


def _show(result: JSON, files: dict[str, Path], *, as_json: bool) -> None:
    constraints = json.loads(files["design.json"].read_text(encoding="utf-8"))["constraints"]
    if as_json:
        paths = {name: str(path) for name, path in files.items()}
        document = {"result": result, "constraints": constraints, "files": paths}
        sys.stdout.write(json.dumps(document, indent=2) + "\n")
    else:
        from service.cli import tables

        tables.print_notes(result)
        tables.print_figures(result)
        tables.print_limits(constraints)
        if result["conflicts"]:
            tables.print_conflicts(result)
        tables.print_files(files)
    if not result["feasible"]:
        sys.stderr.write(f"rigwright: {_why_infeasible(result)}\n")


def _why_infeasible(result: JSON) -> str:
    families = list(dict.fromkeys(name.split("/", 1)[0] for name in result["violated"]))
    in_conflict = [row["family"] for row in result["conflicts"]] or families
    return (
        f"the limits cannot all be met ({', '.join(in_conflict)}); the nearest design was written, "
        "relax one of them"
    )
