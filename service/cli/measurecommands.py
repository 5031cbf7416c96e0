"""The commands about targets and calibration: targets, calibrate, check, accept.

Only what the help needs is imported here, as in the rest of the command line.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Parameter(StrEnum):
    """The parameters of a lens."""

    f = "f"
    cx = "cx"
    cy = "cy"
    k1 = "k1"
    k2 = "k2"
    p1 = "p1"
    p2 = "p2"
    k3 = "k3"
    b1 = "b1"


JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON document instead of tables.")
]
ForceOption = Annotated[bool, typer.Option("--force", help="Replace what is in the folder.")]
OutOption = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Folder to write into.", show_default=False)
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


def add_to(app: typer.Typer) -> None:
    """Add the commands to the program."""
    for command in (targets, calibrate, check, accept):
        app.command()(command)


def targets(
    target_set: Annotated[
        Path | None,
        typer.Argument(metavar="[SET.toml]", help="Targets to print.", show_default=False),
    ] = None,
    design: Annotated[
        Path | None,
        typer.Option(
            metavar="DESIGN.json", help="Propose targets for this rig.", show_default=False
        ),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder to write into.")] = Path(
        "targets"
    ),
    page: Annotated[str, typer.Option(help="A4, A3, letter, or WIDTHxHEIGHT in mm.")] = "A4",
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Print targets at true size, or propose some for a rig.

    Writes the set (targets.toml), a PDF and an SVG per sheet with a check ruler, and a picture per
    carrier for the simulated studio. Measure the ruler on the paper and put its length into the
    set.

    Example:  rigwright targets --design rig/design.json --out targets
    """
    from service.cli.targeting import run_targets_command

    run_targets_command(target_set, design, out, page, as_json=as_json, force=force)


def calibrate(
    pictures: PicturesArgument,
    target_set: TargetsOption,
    out: OutOption,
    design: Annotated[
        Path | None,
        typer.Option(
            metavar="DESIGN.json",
            help="The rig as designed, to start from; from nothing without it.",
            show_default=False,
        ),
    ] = None,
    capture: CaptureOption = None,
    hold: Annotated[
        list[Parameter] | None,
        typer.Option(help="A lens parameter to leave as it is.", show_default=False),
    ] = None,
    free: Annotated[
        list[Parameter] | None,
        typer.Option(help="A lens parameter to take without a prior.", show_default=False),
    ] = None,
    poses_known_to: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="MM DEG",
            help="The design's poses give the frame; they are known this well.",
            show_default=False,
        ),
    ] = None,
    name: Annotated[str, typer.Option(help="What to call it.")] = "",
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Calibrate all cameras of a rig from pictures of targets.

    Exit code: 0 done, 2 bad input, 130 interrupted.

    Example:  rigwright calibrate pictures --targets targets/targets.toml --out calibration
    """
    from service.cli.measuring import Calibrating, run_calibrate_command

    options = Calibrating(
        design, tuple(hold or ()), tuple(free or ()), poses_known_to, name, workers
    )
    run_calibrate_command(pictures, capture, target_set, out, options, as_json=as_json, force=force)


def check(
    pictures: PicturesArgument,
    reference: ReferenceOption,
    out: OutOption,
    target_set: Annotated[
        Path | None,
        typer.Option(
            "--targets",
            metavar="SET.toml",
            help="The targets in the pictures; those of the calibration without it.",
            show_default=False,
        ),
    ] = None,
    capture: CaptureOption = None,
    history: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder of all checks of this rig: this one is added, and a page shows the drift.",
            show_default=False,
        ),
    ] = None,
    tolerance_mm: Annotated[
        float, typer.Option(min=0.0, help="Smaller effects at the subject turn no light red.")
    ] = 0.02,
    hidden_limit_mm: Annotated[
        float, typer.Option(min=1e-6, help="A camera that could hide more is not called fine.")
    ] = 0.1,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Check that a rig is still as it was calibrated: which camera moved, and by how much.

    Exit code: 0 fine (green or yellow), 4 the rig must be looked after (red), 2 bad input.

    Example:  rigwright check sessions/today --reference calibration --out check
    """
    from service.cli.measuring import Checking, run_check_command

    options = Checking(reference, target_set, history, tolerance_mm, hidden_limit_mm, workers)
    run_check_command(pictures, capture, out, options, as_json=as_json, force=force)


def accept(
    pictures: PicturesArgument,
    reference: ReferenceOption,
    target_set: TargetsOption,
    out: OutOption,
    limit: Annotated[
        tuple[float, float, float],
        typer.Option(
            metavar="A K B",
            help="Largest error of a length L: A + K L, at most B (um, um per m, um).",
        ),
    ] = (20.0, 50.0, 50.0),
    volume: Annotated[
        tuple[float, float, float],
        typer.Option(metavar="W H D", help="The volume measured in, mm."),
    ] = (300.0, 300.0, 200.0),
    capture: CaptureOption = None,
    rig: Annotated[str, typer.Option(help="For the certificate.")] = "",
    operator: Annotated[str, typer.Option(help="For the certificate.")] = "",
    temperature: Annotated[
        float | None, typer.Option(help="Degrees Celsius.", show_default=False)
    ] = None,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    force: ForceOption = False,
) -> None:
    """Test a calibrated rig with a calibrated bar along seven lines, and write a certificate.

    In the style of VDI/VDE 2634 part 1 at the scale of a face; it claims no conformity.

    Exit code: 0 passed, 4 failed or incomplete, 2 bad input.

    Example:  rigwright accept bar-pictures --reference calibration --targets bar.toml --out test
    """
    from service.cli.measuring import Accepting, run_accept_command

    options = Accepting(reference, target_set, limit, volume, rig, operator, temperature, workers)
    run_accept_command(pictures, capture, out, options, as_json=as_json, force=force)
