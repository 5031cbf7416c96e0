"""``rigwright plan``."""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

JSON = dict[str, Any]


def plan(
    design: Annotated[
        Path,
        typer.Argument(metavar="DESIGN.json", help="The cameras to hold.", show_default=False),
    ],
    mount: Annotated[
        Path,
        typer.Option(
            metavar="SYSTEM.toml",
            help='What to build with; `kind = "t-slot"` is enough.',
            show_default=False,
        ),
    ],
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder to write into.", show_default=False)
    ],
    scan: Annotated[
        Path | None,
        typer.Option(
            metavar="SCAN",
            help="The head it was designed for; the design knows where it was without it.",
            show_default=False,
        ),
    ] = None,
    name: Annotated[str, typer.Option(help="What to call it; as the design without it.")] = "",
    seed: Annotated[int, typer.Option(min=0, help="Of the trials of tolerances.")] = 0,
    paper: Annotated[str, typer.Option(help="Of drilling templates: A4 or A3.")] = "A4",
    step: Annotated[bool, typer.Option("--step", help="Write printed parts as STEP too.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document instead of tables.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Replace a former plan in the folder.")
    ] = False,
) -> None:
    """Plan what holds the cameras: parts to cut, drill and print, settings, drawings, steps.

    Settings are rounded to what a person can set, and the loss is told.

    Exit code: 0 done, 2 bad input, 3 something clashes, 130 interrupted.

    Example:  rigwright plan rig/design.json --mount t-slot.toml --out plan
    """
    run_plan_command(
        design, mount, scan, out, Planning(name, seed, paper, step), as_json=as_json, force=force
    )


PAPERS = ("A4", "A3")


@dataclass(frozen=True)
class Planning:
    """How to plan."""

    name: str
    seed: int
    paper: str
    step: bool


def run_plan_command(
    design: Path,
    mount: Path,
    scan: Path | None,
    out: Path,
    options: Planning,
    *,
    as_json: bool,
    force: bool,
) -> None:
    """Plan and write into ``out``."""
    from common.errors import InputError
    from common.files.folders import new_folder
    from service.cli.running import one_line_errors, run_task
    from service.cli.scans import scan_of
    from service.problems import EXIT_INFEASIBLE

    with one_line_errors():
        if options.paper not in PAPERS:
            raise InputError("paper", f"there is no paper {options.paper!r}", "give A4 or A3")
        inputs = {"design": design, "mount": mount, "scan": scan or scan_of(design)}
        with new_folder(out, force=force, spare=inputs.values()) as folder:
            result = run_task("service.tasks.planning:plan", asdict(options), inputs, folder)
        _show(result, out, as_json=as_json)
    if not result["buildable"]:
        sys.stderr.write(f"rigwright: {_why(result)}\n")
        raise typer.Exit(EXIT_INFEASIBLE)


def _why(result: JSON) -> str:
    first, more = result["clashes"][0], len(result["clashes"]) - 1
    what = "stands in the view of" if first["kind"] == "view" else "is in the way of"
    return (
        f"{first['other']} {what} {first['one']}{f', and {more} more' if more else ''}; the plan "
        "was written, but cannot be built so: try another mount or other zones"
    )


def _show(result: JSON, out: Path, *, as_json: bool) -> None:
    from common.files.ownership import files_of
    from service.cli.output import print_json

    files = files_of(out)
    if as_json:
        print_json({"result": result, "files": {name: str(path) for name, path in files.items()}})
        return
    from service.cli.tables import plan_tables

    plan_tables.print_plan(result)
    sys.stdout.write(f"Written: {len(files)} files under {out}, begin with {out / 'plan.html'}\n")
