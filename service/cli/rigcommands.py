"""The commands about rigs that stand: capture, rig, trigger, sessions, cameras, fake-trigger.

Only what the help needs is imported here, as in the rest of the command line.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]
StationOption = Annotated[
    Path,
    typer.Option(
        "--station", metavar="STATION.toml", help="Box, cameras, outputs.", show_default=False
    ),
]

rig = typer.Typer(name="rig", help="Look at a rig that stands.", no_args_is_help=True)
trigger = typer.Typer(name="trigger", help="Look at a trigger box.", no_args_is_help=True)
sessions = typer.Typer(name="sessions", help="Look after sessions.", no_args_is_help=True)


def add_to(app: typer.Typer) -> None:
    """Add the commands to the program."""
    app.command()(capture)
    app.command("fake-trigger")(fake_trigger)
    app.command()(cameras)
    for group in (rig, trigger, sessions):
        app.add_typer(group)


def capture(
    station: StationOption,
    session: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Session to file it in, begun if there is none; a new one under sessions/ "
            "without it.",
            show_default=False,
        ),
    ] = None,
    subject: Annotated[str, typer.Option(help="For a new session.")] = "",
    operator: Annotated[str, typer.Option(help="For a new session.")] = "",
    capture_id: Annotated[
        str | None,
        typer.Option(
            "--id",
            help="Name of the capture, fired once for ever; made up without it.",
            show_default=False,
        ),
    ] = None,
    shots: Annotated[int, typer.Option(min=1, help="Shots in a burst.")] = 1,
    interval_ms: Annotated[float, typer.Option(min=0.0, help="From shot to shot.")] = 0.0,
    allow_partial: Annotated[
        bool | None,
        typer.Option(
            "--allow-partial/--no-partial",
            help="Whether cameras may be missing; as the station says without it.",
            show_default=False,
        ),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Do all but fire.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Fire a rig once and file what it photographed, with the proof that it was synchronised.

    Ctrl-C takes all outputs low and files nothing.

    Exit code: 0 done, 2 bad input, 4 a device is missing or a picture is, 130 interrupted.

    Example:  rigwright capture --station station.toml --subject anna
    """
    from service.cli.capturing import Asked, run_capture_command

    asked = Asked(capture_id, subject, operator, shots, interval_ms * 1e3, allow_partial)
    run_capture_command(station, session, asked, dry_run=dry_run, as_json=as_json)


@rig.command("check")
def rig_check(
    station: StationOption,
    fire: Annotated[
        bool, typer.Option("--fire/--no-fire", help="Whether to measure the synchronisation.")
    ] = True,
    captures: Annotated[int, typer.Option(min=1, max=100, help="Captures to measure from.")] = 3,
    write: Annotated[
        bool, typer.Option("--write", help="Write the delays it finds to the station file.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Look at every device, then fire a few times and tell each camera's lag. Files nothing.

    Exit code: 0 all is well, 2 bad input, 4 something is not.

    Example:  rigwright rig check --station station.toml --write
    """
    from service.cli.capturing import run_rig_check_command

    run_rig_check_command(station, captures if fire else 0, write=write, as_json=as_json)


@trigger.command("selftest")
def trigger_selftest(
    url: Annotated[
        str | None,
        typer.Option(
            help="Serial port or pySerial address of a Rigwright box.", show_default=False
        ),
    ] = None,
    station: Annotated[
        Path | None,
        typer.Option(
            "--station",
            metavar="STATION.toml",
            help="The station whose box to test.",
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Ask a trigger box who and how it is: identity, interlock, clock, round trips. Fires nothing.

    Exit code: 0 all is well, 2 bad input, 4 it does not answer or something is not well.

    Example:  rigwright trigger selftest --url /dev/ttyACM0
    """
    from service.cli.boxes import run_trigger_selftest_command

    run_trigger_selftest_command(url, station, as_json=as_json)


@trigger.command("reset")
def trigger_reset(
    url: Annotated[
        str | None,
        typer.Option(
            help="Serial port or pySerial address of a Rigwright box.", show_default=False
        ),
    ] = None,
    station: Annotated[
        Path | None,
        typer.Option(
            "--station",
            metavar="STATION.toml",
            help="The station whose box to reset.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Let a box leave its fault, once its interlock is closed again. Fires nothing.

    Example:  rigwright trigger reset --url /dev/ttyACM0
    """
    from service.cli.boxes import run_trigger_reset_command

    run_trigger_reset_command(url, station)


@sessions.command("verify")
def sessions_verify(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="A session's folder.", show_default=False)
    ],
    as_json: JsonOption = False,
) -> None:
    """Prove a session whole: every file there, unchanged, and none that nobody knows. Reads only.

    Exit code: 0 whole, 2 it is not, or there is no session.

    Example:  rigwright sessions verify sessions/sub-anna/ses-20261122T093000
    """
    from service.cli.filing import run_sessions_verify_command

    run_sessions_verify_command(folder, as_json=as_json)


@sessions.command("recover")
def sessions_recover(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="A session's folder.", show_default=False)
    ],
) -> None:
    """Bring in order what a crash left in a session; the next capture into it does that as well.

    Example:  rigwright sessions recover sessions/sub-anna/ses-20261122T093000
    """
    from service.cli.filing import run_sessions_recover_command

    run_sessions_recover_command(folder)


def cameras(as_json: JsonOption = False) -> None:
    """List the cameras that can be reached now, by every library that is installed.

    Example:  rigwright cameras
    """
    from service.cli.filing import run_cameras_command

    run_cameras_command(as_json=as_json)


def fake_trigger(
    link: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="A symbolic link to the pseudo-terminal, for a name that stays.",
            show_default=False,
        ),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="Offer it on a TCP port of this machine instead; 0 takes a free one.",
            show_default=False,
        ),
    ] = None,
    serial_number: Annotated[str, typer.Option(help="What it calls itself.")] = "fake",
    seed: Annotated[int, typer.Option(min=0, help="Seed of its faults.")] = 0,
    faults: Annotated[
        str, typer.Option(help="Faults and their rates; docs/trigger.md lists them.")
    ] = "",
    drift_ppm: Annotated[float, typer.Option(help="How much too fast its clock runs.")] = 0.0,
) -> None:
    """Be a trigger box, for rigs without one: it speaks the protocol and fires nothing real.

    Example:  rigwright fake-trigger --link box
    """
    from service.cli.boxes import run_fake_trigger_command

    run_fake_trigger_command(link, port, serial_number, seed, faults, drift_ppm)
