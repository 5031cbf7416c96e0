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
    from service.cli.commands.design import run_design
    from service.cli.output import say_next
    from service.cli.running import processes
    from service.kinds.base import RunContext
    from service.kinds.design import DEMO, DemoRequest

    run = RunContext(workers=processes(workers))
    run_design(DEMO, DemoRequest, {}, run, out, as_json=as_json, force=force)
    if not as_json:
        say_next(
            f"open {out / 'report.html'} in a browser, then fire its simulated cameras",
            *("capture", "--station", out / "station.toml", "--session", "sessions/first"),
        )
