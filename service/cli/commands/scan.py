"""``rigwright scan``: tells what a scan file was understood to be."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.cli.options import JsonOption, ScanArgument

if TYPE_CHECKING:
    from rig.specification.sections.subject import ScanSection
    from service.kinds.imports import ScanFacts


def scan(
    scan_file: ScanArgument,
    rig: Annotated[
        Path | None,
        typer.Option(
            "--rig",
            metavar="RIG.toml",
            help="Read it as the [scan] section of this rig file says.",
            show_default=False,
        ),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            "--picture", metavar="FILE.png", help="Draw front and side.", show_default=False
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Tell how a scan was understood: axes, units, nose tip, the face's frame, what was cleaned.

    A design reads scans by the same step. Exit code: 0 understood, 2 not.

    Example:  rigwright scan head.glb --picture head.png
    """
    run_scan_command(scan_file, rig, picture, as_json=as_json)


def run_scan_command(
    scan_file: Path, rig: Path | None, picture: Path | None, *, as_json: bool
) -> None:
    """Read ``scan_file`` as ``rig`` says and show what was understood."""
    import tempfile

    from common.files.writing import write_whole
    from service.cli.output import print_json
    from service.cli.running import one_line_errors, require_files, run_task
    from service.kinds.imports import SCAN_IMPORT, ScanImportRequest

    with one_line_errors(), tempfile.TemporaryDirectory(prefix="rigwright-") as temporary:
        require_files([scan_file, *([rig] if rig else [])])
        _refuse_what_is_there(picture)
        folder = Path(temporary) / "files"
        folder.mkdir()
        request = ScanImportRequest(options=_options(rig), picture=picture is not None)
        found = run_task(SCAN_IMPORT, request, {"upload": scan_file}, folder)
        if picture is not None:
            write_whole(picture, (folder / "scan.png").read_bytes())
        if as_json:
            print_json(found.model_dump(mode="json"))
        else:
            _print(found, picture)


def _refuse_what_is_there(picture: Path | None) -> None:
    """Before the scan is read: a picture replaces no file, least of all the scan itself."""
    from common.errors import ConflictError

    if picture is not None and os.path.lexists(picture):
        raise ConflictError(
            "file-exists", f"{picture} is there already", "give another name for the picture"
        )


def _options(rig: Path | None) -> ScanSection:
    from rig.specification.rigfile import read_rig
    from rig.specification.sections.subject import ScanSection

    return ScanSection() if rig is None else ScanSection.from_options(read_rig(rig).scan_options)


def _print(found: ScanFacts, picture: Path | None) -> None:
    rows = [
        ("vertices, faces", f"{found.vertices:,}, {found.faces:,}"),
        ("unit of the file", found.units or f"{found.mm_per_unit or 0.0:.6g} mm"),
        ("up, front (file)", f"{_vector(found.up, 3)}, {_vector(found.front, 3)}"),
        ("width, depth, height", f"{_vector(found.extents_mm, 1)} mm"),
    ]
    face = found.face
    if face is None:
        rows.append(("face", "not found for certain"))
    else:
        rows += [
            ("face, confidence", f"{face.confidence:.2f}"),
            ("nose tip (file)", _vector(face.nose_tip_file, 4)),
            ("nose tip (rig)", f"{_vector(face.nose_tip_rig_mm, 1)} mm"),
        ]
        rows += [(f"face's {n} (rig)", _vector(v, 3)) for n, v in face.axes_rig.items()]
    for name, value in rows:
        typer.echo(f"{name:<22}{value}")
    for note in found.notes:
        typer.echo(f"{note.kind}: {note.text}")
    if picture is not None:
        typer.echo(f"picture: {picture}")


def _vector(values: list[float] | None, digits: int) -> str:
    return "(" + ", ".join(f"{v:.{digits}f}" for v in values or ()) + ")"
