"""``rigwright catalogue`` and ``rigwright export``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from geometry.exchange import FORMATS, ExportOptions, write_export
from rig.catalogue import catalogue_entry, catalogue_rows, load_catalogue
from rig.design.designfile import read_design
from service.cli.output import print_json
from service.cli.running import one_line_errors


def run_catalogue_command(
    words: str, tables: Sequence[str], where: Sequence[str], files: Sequence[Path], *, as_json: bool
) -> None:
    """List what fits."""
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
    with one_line_errors():
        entry = catalogue_entry(load_catalogue(files), wanted)
        if as_json:
            print_json(entry)
            return
        sys.stdout.write(f"{entry['name']} ({entry['table']} {entry['id']})\n")
        for key, figure in entry["figures"].items():
            source = f"{figure['kind']}: {figure['source']}"
            sys.stdout.write(f"  {key:28} {figure['value']!s:28} {source}\n")


def list_formats() -> None:
    """What can be exported."""
    for form in FORMATS.values():
        sys.stdout.write(f"{form.name:16} {form.program}: {form.description}\n")


def run_export_command(design: Path, form: str, out: Path, image_suffix: str) -> None:
    """Write one export."""
    with one_line_errors():
        cameras = read_design(design).cameras
        written = write_export(out, form, cameras, ExportOptions(image_suffix))
        for path in written.values():
            sys.stdout.write(f"{path}\n")
