"""``rigwright demo``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import ForceOption, JsonOption, WorkersOption


def demo(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder to write into.")] = Path(
        "out/demo"
    ),
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Design the example face rig for the bundled head.

    Example:  rigwright demo --out demo
    """
    run_demo_command(out, workers, as_json=as_json, force=force)


def run_demo_command(out: Path, workers: int | None, *, as_json: bool, force: bool) -> None:
    """Design the example rig for the bundled head."""
    from service.cli.commands.design import Overrides, run_design

    request = Overrides(workers=workers).request()
    run_design("service.tasks.designing:demo", request, {}, out, as_json=as_json, force=force)
