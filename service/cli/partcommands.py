"""The commands ``catalogue`` and ``export``.

Only what the help needs is imported here, as in the rest of the command line.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]


def add_to(app: typer.Typer) -> None:
    """Add the commands to the program."""
    app.command()(catalogue)
    app.command()(export)


def catalogue(
    words: Annotated[
        list[str] | None,
        typer.Argument(help="Words that must occur; all parts without any.", show_default=False),
    ] = None,
    table: Annotated[
        list[str] | None,
        typer.Option(help="Only this kind: camera, lens, head...", show_default=False),
    ] = None,
    where: Annotated[
        list[str] | None,
        typer.Option(help="A condition such as mount=C or 'mass_g<=100'.", show_default=False),
    ] = None,
    show: Annotated[
        str | None,
        typer.Option(metavar="ID", help="One part with all its sources.", show_default=False),
    ] = None,
    parts: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE.toml", help="Parts of your own, laid over these.", show_default=False
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """List and search cameras, lenses and the other parts a rig file can name.

    Example:  rigwright catalogue canon --table lens --where 'focal_length_mm>=50'
    """
    from service.cli.parts import run_catalogue_command, run_part_command

    if show is not None:
        run_part_command(show, parts or [], as_json=as_json)
        return
    run_catalogue_command(
        " ".join(words or []), table or [], where or [], parts or [], as_json=as_json
    )


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
    from service.cli.parts import list_formats, run_export_command

    if form is None:
        list_formats()
        return
    run_export_command(design_file, form, out or Path(form), image_suffix)
