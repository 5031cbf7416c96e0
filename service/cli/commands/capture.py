"""``rigwright capture``."""

from __future__ import annotations

import sys
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from common.progress import within
from common.words import counted
from service.cli.options import (
    JsonOption,
    KeyOption,
    RigNameOption,
    ServedStationOption,
    ServerOption,
)

if TYPE_CHECKING:
    from common.progress import ProgressCallback
    from service.cli.owner import Taken


def capture(
    station: ServedStationOption = None,
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
    interval_us: Annotated[
        float, typer.Option(min=0.0, help="From shot to shot, in microseconds.")
    ] = 0.0,
    interval_ms: Annotated[float, typer.Option(min=0.0, hidden=True)] = 0.0,
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
    server: ServerOption = None,
    key: KeyOption = None,
    rig: RigNameOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fire a rig and file what it photographed, with the proof that it was synchronised.

    Ctrl-C takes all outputs low and files nothing of the capture that is being taken. Where a
    service runs the rig, it is asked, and files in its own sessions.

    Exit code: 0 done, 2 bad input, 4 a device is missing or a picture is, 130 interrupted.

    Example:  rigwright capture --station station.toml --subject anna
    """
    from contextlib import ExitStack

    from common.errors import CancelledError, InputError
    from service.cli.output import show
    from service.cli.owner import Asked, rig_to_ask
    from service.cli.progress import show_progress
    from service.cli.running import cancel_on_signal, one_line_errors
    from service.kinds.rigs import CaptureRequest, RigTestRequest

    with one_line_errors(), ExitStack() as stack:
        if interval_us and interval_ms:
            raise InputError("interval", "the interval is given twice", "give --interval-us alone")
        apart_us = interval_us or 1e3 * interval_ms
        if count > 1 and capture_id is not None:
            raise InputError(
                "capture-id-count",
                "captures of one id are one capture",
                "leave --id or --count out",
            )
        ids = CaptureIds()

        def request() -> CaptureRequest:
            return CaptureRequest(
                capture_id=capture_id or ids.next(),
                subject=subject,
                operator=operator,
                shots=shots,
                interval_us=apart_us,
                allow_partial=allow_partial,
            )

        request()  # What is wrong with it is told before a device is opened.
        asked = stack.enter_context(rig_to_ask(Asked(station, server, key, rig)))
        cancel = stack.enter_context(cancel_on_signal())
        report = stack.enter_context(show_progress())
        if dry_run:
            test = RigTestRequest(
                test="dry-run", shots=shots, interval_us=apart_us, allow_partial=allow_partial
            )
            dry = asked.test(test, report, cancel)
            faults = [fault.text for fault in dry.faults]
            show({"ready": list(dry.ready), "faults": faults}, as_json=as_json)
            return
        asked.file_in(session, request())
        for number in range(count):
            if number and cancel.wait(pause_s):
                raise CancelledError
            telling = report if count == 1 else _one_of(report, number, count)
            taken = asked.capture(request(), telling, cancel)
            if count == 1 or as_json:
                _show(taken, as_json=as_json)
            else:
                _show_in_a_line(taken, number, count)
            if taken.error is not None:
                raise taken.error


class CaptureIds:
    """Names of captures: sorted as texts, they stand in the order in which they were made up."""

    def __init__(self) -> None:
        self._last = datetime.min

    def next(self) -> str:
        """The time to the millisecond, and letters that no other computer makes up."""
        from secrets import token_hex

        now = datetime.now()
        now = now.replace(microsecond=now.microsecond // 1000 * 1000)
        self._last = max(now, self._last + timedelta(milliseconds=1))
        return f"cap-{self._last:%Y%m%dT%H%M%S}-{self._last.microsecond // 1000:03d}-{token_hex(3)}"


def _one_of(report: ProgressCallback, number: int, count: int) -> ProgressCallback:
    """Progress of one capture of several: which it is, without its own stages."""
    from dataclasses import replace

    part = within(report, number / count, (number + 1) / count)
    stage = f"capture {number + 1} of {count}"
    return lambda progress, /: part(replace(progress, stage=stage))


def _show(taken: Taken, *, as_json: bool) -> None:
    from service.cli.output import show

    record = taken.record
    show(
        {
            "capture": record.capture_id,
            "session": taken.session,
            "state": record.state,
            # Its sentence begins with the word; machines know it by the older name.
            "synchronised" if as_json else "verdict": record.verdict.text,
            "faults": [fault.text for fault in record.faults],
            "pictures": taken.pictures,
        },
        as_json=as_json,
    )


def _show_in_a_line(taken: Taken, number: int, count: int) -> None:
    record = taken.record
    if number == 0:
        sys.stdout.write(f"session: {taken.session}\n")
    sys.stdout.write(
        f"{number + 1} of {count}: {record.capture_id}, {record.state}, "
        f"{counted(len(taken.pictures), 'picture')}; {record.verdict.text}\n"
    )
    for fault in record.faults:
        sys.stdout.write(f"  fault: {fault.text}\n")
    sys.stdout.flush()
