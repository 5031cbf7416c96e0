"""``rigwright catalogue``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import JsonOption


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
    if show is not None:
        run_part_command(show, parts or [], as_json=as_json)
        return
    run_catalogue_command(
        " ".join(words or []), table or [], where or [], parts or [], as_json=as_json
    )


def run_catalogue_command(
    words: str, tables: Sequence[str], where: Sequence[str], files: Sequence[Path], *, as_json: bool
) -> None:
    """List what fits."""
    from rig.catalogue import catalogue_rows, load_catalogue
    from service.cli.output import print_json
    from service.cli.running import one_line_errors

    with one_line_errors():
        rows = catalogue_rows(load_catalogue(files), words, tables, where)
        if as_json:
            print_json({"parts": rows})
            return
        for row in rows:
            sys.stdout.write(f"{row['table']:9} {row['id']:36} {row['name']}\n")
        sys.stdout.write(f"{len(rows)} parts; --show ID tells all of one\n")


def run_part_command(wanted: str, files: Sequence[Path], *, as_json: bool) -> None:
    """Show one part, each figure with its source."""
    from rig.catalogue import catalogue_entry, load_catalogue
    from service.cli.output import print_json
    from service.cli.running import one_line_errors

    with one_line_errors():
        entry = catalogue_entry(load_catalogue(files), wanted)
        if as_json:
            print_json(entry)
            return
        sys.stdout.write(f"{entry['name']} ({entry['table']} {entry['id']})\n")
        for key, figure in entry["figures"].items():
            source = f"{figure['kind']}: {figure['source']}"
            sys.stdout.write(f"  {key:28} {figure['value']!s:28} {source}\n")
