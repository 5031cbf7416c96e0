"""Options and arguments that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

ScanArgument = Annotated[
    Path,
    typer.Argument(
        metavar="SCAN",
        help="The head: GLB, glTF, OBJ, PLY, STL, 3MF, OFF or XYZ.",
        show_default=False,
    ),
]
RigOption = Annotated[
    Path,
    typer.Option("--rig", metavar="RIG.toml", help="Camera, limits and start.", show_default=False),
]
StationOption = Annotated[
    Path,
    typer.Option(
        "--station", metavar="STATION.toml", help="Box, cameras, outputs.", show_default=False
    ),
]
ServedStationOption = Annotated[
    Path | None,
    typer.Option(
        "--station",
        metavar="STATION.toml",
        help="Box, cameras, outputs. A service that runs this rig is asked to do it.",
        show_default=False,
    ),
]
ServerOption = Annotated[
    str | None,
    typer.Option(
        "--server",
        metavar="URL",
        help="The service to ask, such as http://rig-pc:8000; found by itself on this computer.",
        show_default=False,
    ),
]
KeyOption = Annotated[
    str | None,
    typer.Option(
        "--key", envvar="RIGWRIGHT_KEY", help="A key for the service.", show_default=False
    ),
]
RigNameOption = Annotated[
    str | None,
    typer.Option(
        "--rig",
        metavar="NAME",
        help="Which rig of --server, without --station.",
        show_default=False,
    ),
]
OutOption = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Folder to write into.", show_default=False)
]
DataOption = Annotated[
    Path | None,
    typer.Option(
        "--data", metavar="DIR", help="The service's data folder, as for serve.", show_default=False
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON document instead of tables.")
]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Replace former results in the folder; never other files.")
]
WorkersOption = Annotated[
    int | None,
    typer.Option(
        min=1, max=1024, help="Processes to use; one per core without it.", show_default=False
    ),
]
PicturesArgument = Annotated[
    Path,
    typer.Argument(
        metavar="PICTURES",
        help="A session, or a folder or ZIP archive with a folder per camera "
        "(cam01/0001.png; one name, one instant).",
        show_default=False,
    ),
]
CaptureOption = Annotated[
    list[str] | None,
    typer.Option("--capture", help="A capture of the session; all without it.", show_default=False),
]
TargetsOption = Annotated[
    Path,
    typer.Option(
        "--targets", metavar="SET.toml", help="The targets in the pictures.", show_default=False
    ),
]
ReferenceOption = Annotated[
    Path,
    typer.Option(
        "--reference",
        metavar="CALIBRATION",
        help="What `rigwright calibrate` wrote: the folder or its calibration.json.",
        show_default=False,
    ),
]
