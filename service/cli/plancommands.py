"""``rigwright plan``.

Only what the help needs is imported here, as in the rest of the command line.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def add_to(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command()(plan)


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
            help="The head it was designed for; looked for beside the design without it.",
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
    force: Annotated[bool, typer.Option("--force", help="Replace what is in the folder.")] = False,
) -> None:
    """Plan what holds the cameras: parts to cut, drill and print, settings, drawings, steps.

    Settings are rounded to what a person can set, and the loss is told.

    Exit code: 0 done, 2 bad input, 3 something clashes, 130 interrupted.

    Example:  rigwright plan rig/design.json --mount t-slot.toml --out plan
    """
    from service.cli.planning import Planning, run_plan_command

    run_plan_command(
        design, mount, scan, out, Planning(name, seed, paper, step), as_json=as_json, force=force
    )
