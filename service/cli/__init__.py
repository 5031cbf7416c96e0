"""The command ``rigwright``.

Only what the help needs is imported here; a command imports its own tools when it runs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.cli import measurecommands, partcommands, plancommands, rigcommands

app = typer.Typer(
    name="rigwright",
    help="Designs and runs multi-camera rigs that photograph a face from all sides at one instant.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

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
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON document instead of tables.")
]
ForceOption = Annotated[bool, typer.Option("--force", help="Replace what is in the folder.")]
WorkersOption = Annotated[
    int | None,
    typer.Option(
        min=1, max=1024, help="Processes to use; one per core without it.", show_default=False
    ),
]


def _print_version(wanted: bool) -> None:
    if wanted:
        from rig.design.designfile import program_version

        typer.echo(f"rigwright {program_version()}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Designs multi-camera rigs that photograph a face from all sides at one instant."""


@app.command()
def design(
    scan: ScanArgument,
    rig: RigOption,
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="Folder to write the design into.", show_default=False),
    ],
    cameras: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=500,
            help="Cameras to place, instead of the rig's number.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed, instead of the rig's.", show_default=False)
    ] = None,
    starts: Annotated[
        int | None,
        typer.Option(
            min=1, max=1000, help="Starts to try, instead of the rig's number.", show_default=False
        ),
    ] = None,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Design a rig: a scan and its limits in, camera poses and a mount layout out.

    When the limits cannot all be met, the nearest design is written and told apart.

    Exit code: 0 done, 2 bad input, 3 limits cannot be met, 130 interrupted.

    Example:  rigwright design head.glb --rig face.toml --out rig --cameras 7
    """
    from service.cli.designing import Overrides, run_design_command

    run_design_command(
        scan, rig, out, Overrides(cameras, seed, starts, workers), as_json=as_json, force=force
    )


@app.command()
def evaluate(
    design_file: Annotated[
        Path,
        typer.Argument(metavar="DESIGN.json", help="The cameras to score.", show_default=False),
    ],
    scan: ScanArgument,
    rig: RigOption,
    as_json: JsonOption = False,
) -> None:
    """Score given cameras with the figures of a design. Writes no files.

    Of an existing rig, the keys "schema" and "cameras" of a design file are enough.

    Example:  rigwright evaluate rig/design.json head.glb --rig face.toml
    """
    from service.cli.evaluating import run_evaluate_command

    run_evaluate_command(design_file, scan, rig, as_json=as_json)


@app.command()
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
    from service.cli.designing import run_demo_command

    run_demo_command(out, workers, as_json=as_json, force=force)


@app.command()
def serve(
    host: Annotated[
        str | None,
        typer.Option(help="Address to listen on; 127.0.0.1 without it.", show_default=False),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            min=0, max=65535, help="Port; 8000 without it, 0 takes a free one.", show_default=False
        ),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder for everything the service keeps.", show_default=False
        ),
    ] = None,
    station: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="STATION.toml",
            help="A rig to run; may be given several times.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Offer designs, and rigs that stand, over HTTP under /v1. The guide is docs/api.md.

    Example:  rigwright serve --port 8000 --data rigwright-data --station station.toml
    """
    from service.cli.serving import run_serve_command

    run_serve_command(host, port, data, station)


partcommands.add_to(app)
plancommands.add_to(app)
measurecommands.add_to(app)
rigcommands.add_to(app)


def main() -> None:
    """Run the command line."""
    app()
