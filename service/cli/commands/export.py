"""``rigwright export``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer


def export(
    design_file: Annotated[
        Path, typer.Argument(metavar="DESIGN.json", help="The cameras.", show_default=False)
    ],
    form: Annotated[
        str | None,
        typer.Option("--format", help="Which; without it they are listed.", show_default=False),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="New folder; named like the format without it."),
    ] = None,
    image_suffix: Annotated[str, typer.Option(help="How names of pictures end.")] = ".jpg",
) -> None:
    """Write a design's cameras for photogrammetry software and 3D programs.

    Example:  rigwright export rig/design.json --format colmap-text --out colmap
    """
    if form is None:
        list_formats()
        return
    run_export_command(design_file, form, out or Path(form), image_suffix)


def list_formats() -> None:
    """What can be exported."""
    from geometry.exchange import FORMATS

    for form in FORMATS.values():
        sys.stdout.write(f"{form.name:16} {form.program}: {form.description}\n")


def run_export_command(design: Path, form: str, out: Path, image_suffix: str) -> None:
    """Write one export."""
    from geometry.exchange import ExportOptions, write_export
    from rig.design.designfile import read_design
    from service.cli.running import one_line_errors

    with one_line_errors():
        cameras = read_design(design).cameras
        written = write_export(out, form, cameras, ExportOptions(image_suffix))
        for path in written.values():
            sys.stdout.write(f"{path}\n")
