"""``rigwright capture``."""

from __future__ import annotations

import secrets
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from service.cli.options import JsonOption, StationOption

if TYPE_CHECKING:
    from rig.acquisition.capture.results import CaptureResult
    from rig.acquisition.capture.rig import Rig
    from rig.acquisition.session.folder import Session

JSON = dict[str, Any]


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
    count: Annotated[
        int, typer.Option(min=1, max=1000, help="Captures to take, one after another.")
    ] = 1,
    pause_s: Annotated[
        float, typer.Option(min=0.0, help="From one capture to the next, to move what is held.")
    ] = 0.0,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Do all but fire.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Fire a rig and file what it photographed, with the proof that it was synchronised.

    Ctrl-C takes all outputs low and files nothing of the capture that is being taken.

    Exit code: 0 done, 2 bad input, 4 a device is missing or a picture is, 130 interrupted.

    Example:  rigwright capture --station station.toml --subject anna
    """
    asked = Asked(
        capture_id, subject, operator, shots, interval_ms * 1e3, allow_partial, count, pause_s
    )
    run_capture_command(station, session, asked, dry_run=dry_run, as_json=as_json)


SESSIONS = Path("sessions")


@dataclass(frozen=True)
class Asked:
    """What a capture was asked for with."""

    capture_id: str | None
    subject: str
    operator: str
    shots: int
    interval_us: float
    allow_partial: bool | None
    count: int = 1
    pause_s: float = 0.0


def run_capture_command(
    station: Path, folder: Path | None, asked: Asked, *, dry_run: bool, as_json: bool
) -> None:
    """Take captures, or rehearse one."""
    from common.errors import CancelledError, InputError
    from rig.acquisition.station.stationfile import read_station
    from rig.devices.station import open_station
    from service.cli.output import show
    from service.cli.progress import show_progress, told
    from service.cli.running import cancel_on_signal, one_line_errors

    with one_line_errors(), ExitStack() as stack:
        if asked.count > 1 and asked.capture_id is not None:
            raise InputError(
                "capture-id-count",
                "captures of one id are one capture",
                "leave --id or --count out",
            )
        rig = stack.enter_context(open_station(read_station(station)))
        cancel = stack.enter_context(cancel_on_signal())
        report = told(stack.enter_context(show_progress()))
        if dry_run:
            dry = rig.dry_run(
                shots=asked.shots,
                interval_us=asked.interval_us,
                allow_partial=asked.allow_partial,
                progress=report,
                cancel=cancel,
            )
            show({"ready": dry.ready, "faults": [f.text for f in dry.faults]}, as_json=as_json)
            return
        session = stack.enter_context(_session(rig, folder, asked))
        for number in range(asked.count):
            if number and cancel.wait(asked.pause_s):
                raise CancelledError
            result = rig.capture(
                session,
                asked.capture_id or f"cap-{datetime.now():%Y%m%dT%H%M%S}-{secrets.token_hex(3)}",
                shots=asked.shots,
                interval_us=asked.interval_us,
                allow_partial=asked.allow_partial,
                progress=report,
                cancel=cancel,
            )
            show(_capture_figures(result), as_json=as_json)
            if result.error is not None:
                raise result.error


def _session(rig: Rig, folder: Path | None, asked: Asked) -> Session:
    from common.errors import NotFoundError
    from rig.acquisition.session.folder import Session, session_folder

    if folder is None:
        return rig.new_session(
            session_folder(SESSIONS, asked.subject), asked.subject, asked.operator
        )
    try:
        return Session.open(folder)
    except NotFoundError:
        if folder.exists():
            raise
        return rig.new_session(folder, asked.subject, asked.operator)


def _capture_figures(result: CaptureResult) -> JSON:
    record = result.record
    return {
        "capture": record.capture_id,
        "session": str(result.folder),
        "state": record.state,
        "synchronised": record.verdict.text,
        "faults": [fault.text for fault in record.faults],
        "pictures": [str(result.folder / frame.file.path) for frame in record.frames],
    }
