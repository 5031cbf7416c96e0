"""``rigwright design``."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from service.cli.options import ForceOption, JsonOption, RigOption, ScanArgument, WorkersOption

JSON = dict[str, Any]


def design(
    scan: ScanArgument,
    rig: RigOption,
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="Folder to write the design into.", show_default=False),
    ],
    cameras: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=500,
            help="Cameras to place, instead of the rig's number.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed, instead of the rig's.", show_default=False)
    ] = None,
    starts: Annotated[
        int | None,
        typer.Option(
            min=1, max=1000, help="Starts to try, instead of the rig's number.", show_default=False
        ),
    ] = None,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Design a rig: a scan and its limits in, camera poses and a mount layout out.

    When the limits cannot all be met, the nearest design is written and told apart.

    Exit code: 0 done, 2 bad input, 3 limits cannot be met, 130 interrupted.

    Example:  rigwright design head.glb --rig face.toml --out rig --cameras 7
    """
    run_design_command(
        scan, rig, out, Overrides(cameras, seed, starts, workers), as_json=as_json, force=force
    )


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
    run_design(
        "service.tasks.designing:design_from_files",
        request,
        inputs,
        out,
        as_json=as_json,
        force=force,
    )


def run_design(
    entry: str, request: JSON, inputs: dict[str, Path], out: Path, *, as_json: bool, force: bool
) -> None:
    """Run the work and show what came of it."""
    from common.files.folders import new_folder
    from common.files.ownership import files_of
    from service.cli.running import one_line_errors, run_task
    from service.cli.scans import remember_scan
    from service.problems import EXIT_INFEASIBLE

    with one_line_errors():
        with new_folder(out, force=force, spare=inputs.values()) as folder:
            result = run_task(entry, request, inputs, folder)
            if "scan" in inputs:
                remember_scan(folder, out, inputs["scan"])
        _show(result, files_of(out), as_json=as_json)
    if not result["feasible"]:
        raise typer.Exit(EXIT_INFEASIBLE)


def _show(result: JSON, files: dict[str, Path], *, as_json: bool) -> None:
    constraints = json.loads(files["design.json"].read_text(encoding="utf-8"))["constraints"]
    if as_json:
        paths = {name: str(path) for name, path in files.items()}
        document = {"result": result, "constraints": constraints, "files": paths}
        sys.stdout.write(json.dumps(document, indent=2) + "\n")
    else:
        from service.cli.tables import design_tables

        design_tables.print_notes(result)
        design_tables.print_figures(result)
        design_tables.print_limits(constraints)
        if result["conflicts"]:
            design_tables.print_conflicts(result)
        design_tables.print_files(files)
    if not result["feasible"]:
        sys.stderr.write(f"rigwright: {_why_infeasible(result)}\n")


def _why_infeasible(result: JSON) -> str:
    families = list(dict.fromkeys(name.split("/", 1)[0] for name in result["violated"]))
    in_conflict = [row["family"] for row in result["conflicts"]] or families
    return (
        f"the limits cannot all be met ({', '.join(in_conflict)}); the nearest design was written, "
        "relax one of them"
    )
