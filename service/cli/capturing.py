"""``rigwright capture`` and ``rigwright rig check``."""

from __future__ import annotations

import secrets
import sys
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import typer

from common.errors import NotFoundError
from common.progress import Progress, ProgressCallback
from rig.acquisition.capture.results import CaptureResult, SelfTest, SyncCheck
from rig.acquisition.capture.rig import Rig, open_station
from rig.acquisition.session.folder import Session, session_folder
from rig.acquisition.station.delays import write_timings
from rig.acquisition.station.stationfile import read_station
from service.cli.output import NOT_WELL, print_json, show
from service.cli.progress import show_progress
from service.cli.running import cancel_on_signal, one_line_errors
from service.rigs.orders import self_test_document, sync_document
from service.wire import plain

JSON = dict[str, Any]
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


def run_capture_command(
    station: Path, folder: Path | None, asked: Asked, *, dry_run: bool, as_json: bool
) -> None:
    """Take one capture, or rehearse it."""
    with one_line_errors(), ExitStack() as stack:
        rig = stack.enter_context(open_station(read_station(station)))
        cancel = stack.enter_context(cancel_on_signal())
        report = _told(stack.enter_context(show_progress()))
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
        result = rig.capture(
            session,
            asked.capture_id or f"cap-{datetime.now():%Y%m%dT%H%M%S}-{secrets.token_hex(3)}",
            shots=asked.shots,
            interval_us=asked.interval_us,
            allow_partial=asked.allow_partial,
            progress=report,
            cancel=cancel,
        )
        stack.close()
        show(_capture_figures(result), as_json=as_json)
        if result.error is not None:
            raise result.error


def _session(rig: Rig, folder: Path | None, asked: Asked) -> Session:
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


def run_rig_check_command(station: Path, captures: int, *, write: bool, as_json: bool) -> None:
    """Self-test, then the synchronisation, as far as the devices are well."""
    with one_line_errors(), ExitStack() as stack:
        rig = stack.enter_context(open_station(read_station(station)))
        test = rig.self_test()
        check: SyncCheck | None = None
        if test.ok and captures:
            cancel = stack.enter_context(cancel_on_signal())
            report = _told(stack.enter_context(show_progress()))
            check = rig.sync_check(captures, progress=report, cancel=cancel)
        stack.close()
        written = write and check is not None and check.timings is not None
        if written and check is not None and check.timings is not None:
            write_timings(station, check.timings)
        document = {"self_test": self_test_document(test), "written": written}
        document["sync_check"] = None if check is None else sync_document(check)
        if as_json:
            print_json(document)
        else:
            _print_checks(test)
            if check is not None:
                _print_sync(check, written=written)
    well = test.ok and (check is None or bool(sync_document(check)["ok"]))
    if not well:
        raise typer.Exit(NOT_WELL)


def _told(report: Any) -> ProgressCallback:  # noqa: ANN401 - what show_progress gives
    def tell(progress: Progress, /) -> None:
        report(plain(progress))

    return tell


def _print_checks(test: SelfTest) -> None:
    for check in test.checks:
        sys.stdout.write(f"{'ok ' if check.ok else 'BAD'} {check.name}: {check.text}\n")


def _print_sync(check: SyncCheck, *, written: bool) -> None:
    for number, evidence in enumerate(check.captures, 1):
        sys.stdout.write(f"capture {number}: {evidence.verdict.text}\n")
    for fault in check.faults:
        sys.stdout.write(f"fault: {fault.text}\n")
    for name, lag in check.lags.items():
        sys.stdout.write(
            f"{name}: lag {lag.lag_us / 1e3:.2f} ms +- {lag.uncertainty_us / 1e3:.2f} ms "
            f"({lag.source})\n"
        )
    if check.timings is None:
        sys.stdout.write(f"no delays: {check.why_not}\n")
        return
    for name, timing in check.timings.items():
        sys.stdout.write(f"{name}: delay {timing.delay_us / 1e3:.2f} ms makes up for it\n")
    sys.stdout.write("written to the station file\n" if written else "--write keeps these delays\n")
