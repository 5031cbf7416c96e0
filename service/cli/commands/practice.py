"""``rigwright practice``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import ForceOption


def practice(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder to write into.")] = Path(
        "practice"
    ),
    force: ForceOption = False,
) -> None:
    """Write simulated stations and targets, to calibrate, check and accept without hardware.

    Example:  rigwright practice --out practice
    """
    from common.files.folders import new_folder
    from common.files.ownership import files_of
    from service.cli.output import say_next
    from service.cli.running import one_line_errors

    with one_line_errors():
        with new_folder(out, force=force) as folder:
            from service.practice import write_practice

            write_practice(folder)
        for path in files_of(out).values():
            sys.stdout.write(f"{path}\n")
        say_next(
            "photograph its targets in twelve places",
            *("capture", "--station", out / "station.toml"),
            *("--session", "sessions/monday", "--count", 12),
        )
