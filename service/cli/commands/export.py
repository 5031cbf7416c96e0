"""``rigwright export``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from geometry.camera import RigCamera


def export(
    cameras: Annotated[
        Path,
        typer.Argument(
            metavar="CAMERAS",
            help="A design or a calibration: its folder, or its design.json or calibration.json.",
            show_default=False,
        ),
    ],
    form: Annotated[
        str | None,
        typer.Option("--format", help="Which; without it they are listed.", show_default=False),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="New folder; named like the format without it."),
    ] = None,
    design: Annotated[
        Path | None,
        typer.Option(
            metavar="DESIGN.json",
            help="Of a calibration: the design that was calibrated, for pixel pitch and bodies.",
            show_default=False,
        ),
    ] = None,
    image_suffix: Annotated[str, typer.Option(help="How names of pictures end.")] = ".jpg",
) -> None:
    """Write the cameras of a design or a calibration for photogrammetry and 3D programs.

    Example:  rigwright export rig/design.json --format colmap-text --out colmap

    Example:  rigwright export my-calibration --format opencv --out opencv
    """
    if form is None:
        list_formats()
        return
    run_export_command(cameras, form, out or Path(form), design, image_suffix)


def list_formats() -> None:
    """What can be exported."""
    from geometry.exchange import FORMATS

    for form in FORMATS.values():
        sys.stdout.write(f"{form.name:16} {form.program}: {form.description}\n")


def run_export_command(
    cameras: Path, form: str, out: Path, design: Path | None, image_suffix: str
) -> None:
    """Write one export."""
    from geometry.exchange import ExportOptions, write_export
    from service.cli.running import one_line_errors

    with one_line_errors():
        chosen = _cameras(cameras, design)
        written = write_export(out, form, chosen, ExportOptions(image_suffix))
        for path in written.values():
            sys.stdout.write(f"{path}\n")


def _cameras(given: Path, design: Path | None) -> tuple[RigCamera, ...]:
    from common.errors import InputError
    from service.tasks.exporting import calibrated_cameras, designed_cameras

    path = _file_in(given)
    if _schema(path).startswith("rigwright.calibration/"):
        return calibrated_cameras(path, design)
    if design is not None:
        raise InputError(
            "export-design",
            f"{path} is no calibration",
            "leave --design out",
        )
    return designed_cameras(path)


def _file_in(given: Path) -> Path:
    """The file to read of a folder that ``rigwright`` wrote; a file is itself."""
    from common.errors import InputError

    if not given.is_dir():
        return given
    for name in ("calibration.json", "design.json"):
        if (given / name).is_file():
            return given / name
    raise InputError(
        "export-folder",
        f"the folder {given} holds neither calibration.json nor design.json",
        "give what `rigwright design` or `rigwright calibrate` wrote",
    )


def _schema(path: Path) -> str:
    """What a file says it is; nothing where it cannot be read, which its reader will tell."""
    from common.files.reading import json_in

    try:
        document = json_in(path)
    except (OSError, ValueError):
        return ""
    return str(document.get("schema", "")) if isinstance(document, dict) else ""
