"""All exports by name, and how to write one to a folder."""

from __future__ import annotations

from pathlib import Path

from common.errors import NotFoundError
from common.files.folders import refuse_others, whole_folder
from common.words import did_you_mean
from geometry.exchange import (
    blender,
    caliscope,
    colmap,
    gltf,
    kalibr,
    meshroom,
    metashape,
    nerfstudio,
    opencv_yaml,
    realityscan,
    usd,
)
from geometry.exchange.base import (
    Cameras,
    ExportOptions,
    Files,
    Format,
    check_cameras,
    check_lenses,
)

FORMATS: dict[str, Format] = {
    form.name: form
    for form in (
        colmap.TEXT,
        colmap.BINARY,
        metashape.XML,
        metashape.CSV,
        realityscan.FORMAT,
        nerfstudio.FORMAT,
        meshroom.FORMAT,
        opencv_yaml.FORMAT,
        blender.FORMAT,
        gltf.FORMAT,
        usd.FORMAT,
        kalibr.FORMAT,
        caliscope.FORMAT,
    )
}
"""Exports by the name a user chooses them with."""


def find_format(name: str) -> Format:
    """The export ``name``; raises :class:`NotFoundError` with the nearest name."""
    if name in FORMATS:
        return FORMATS[name]
    raise NotFoundError(
        "export-format",
        f"there is no export format {name!r}",
        did_you_mean(name.lower(), FORMATS),
    )


def export_files(name: str, cameras: Cameras, options: ExportOptions | None = None) -> Files:
    """The files of the export ``name`` by relative name; nothing is written.

    Raises :class:`NotFoundError` for an unknown format and :class:`InputError` for cameras
    that it cannot tell apart, or with lenses that it cannot describe.
    """
    form = find_format(name)
    check_cameras(cameras)
    check_lenses(cameras, form)
    return form.write(cameras, options or ExportOptions())


def write_export(
    out: Path, name: str, cameras: Cameras, options: ExportOptions | None = None
) -> dict[str, Path]:
    """Write an export to the new or empty folder ``out``; returns the paths by file name.

    The files are written beside it and renamed, so that ``out`` never holds half an export.
    """

    def may_go(held: Path) -> None:
        refuse_others(held, ())

    may_go(out)
    files = export_files(name, cameras, options)
    with whole_folder(out, may_go) as half:
        for file_name, content in files.items():
            (half / file_name).write_bytes(content)
    return {file_name: out / file_name for file_name in files}
