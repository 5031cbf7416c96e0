"""``rigwright capture``, ``rig``, ``trigger``, ``sessions``, ``cameras`` and ``fake-trigger``."""

from __future__ import annotations

import dataclasses
import json
import secrets
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import typer

from geometry.errors import InputError, NotFoundError
from rig.capture.results import CaptureResult, SelfTest, SyncCheck
from rig.capture.rig import Rig, open_station
from rig.session.folder import Session, session_folder
from rig.session.verify import verify_session
from rig.station.delays import write_timings
from rig.station.stationfile import read_station
from rig.trigger.box import TriggerBox, TriggerCapabilities, TriggerHealth
from service.cli.progress import show_progress
from service.cli.running import cancel_on_signal, one_line_errors
from service.problems import KINDS
from service.rigs.orders import self_test_document, sync_document
from service.wire import plain
from solver.progress import Progress, ProgressCallback

JSON = dict[str, Any]
NOT_WELL = KINDS["device"].exit_code
SESSIONS = Path("sessions")
WORST_CLOCK_US = 500.0


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
            _show({"ready": dry.ready, "faults": [f.text for f in dry.faults]}, as_json=as_json)
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
        _show(_capture_figures(result), as_json=as_json)
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
            _print_json(document)
        else:
            _print_checks(test)
            if check is not None:
                _print_sync(check, written=written)
    well = test.ok and (check is None or bool(sync_document(check)["ok"]))
    if not well:
        raise typer.Exit(NOT_WELL)


def run_trigger_selftest_command(url: str | None, station: Path | None, *, as_json: bool) -> None:
    """Open a box and tell how it is."""
    with one_line_errors():
        with _open_box(url, station) as box:
            health, capabilities = box.health(), box.capabilities
        document = {"ok": _box_well(health), "health": health, "capabilities": capabilities}
        if as_json:
            _print_json(document)
        else:
            _print_box(health, capabilities)
    if not _box_well(health):
        raise typer.Exit(NOT_WELL)


def run_trigger_reset_command(url: str | None, station: Path | None) -> None:
    """Let a box leave its fault."""
    with one_line_errors(), _open_box(url, station) as box:
        box.reset()
        sys.stdout.write(f"the box is {box.health().state}\n")


@contextmanager
def _open_box(url: str | None, station: Path | None) -> Iterator[TriggerBox]:
    from rig.capture.devices import StationDevices
    from rig.station.spec import TriggerPlan

    if (url is None) == (station is None):
        raise InputError("box", "no box, or two, were named", "give --url or --station")
    plan = TriggerPlan("rigwright", url) if url else read_station(station or Path()).trigger
    if plan is None:
        raise InputError("box", "the station has no trigger box", "add [trigger] to its file")
    with ExitStack() as stack:
        devices = StationDevices()
        stack.callback(devices.close)
        box = devices.make_box(plan)
        stack.callback(box.close)
        box.open()
        yield box


def _print_box(health: TriggerHealth, can: TriggerCapabilities) -> None:
    interlock = {True: "closed", False: "OPEN", None: "none"}[health.interlock_closed]
    lines = [
        f"{health.identity}, serial number {health.serial_number}, firmware {health.firmware}",
        f"state: {health.state}; interlock: {interlock}; started {health.boots} times",
        f"{can.outputs} outputs, steps of {can.tick_us:g} us, delays up to "
        f"{can.max_delay_us / 1e6:g} s, pulses up to {can.max_width_us / 1e6:g} s, "
        f"bursts of up to {can.max_shots}",
    ]
    if health.round_trip_p50_ms is not None:
        lines.append(f"round trip: {health.round_trip_p50_ms:.2f} ms median")
    if health.clock_residual_us is not None:
        lines.append(f"its clock is known to {health.clock_residual_us:.0f} us")
    if health.last_problem:
        lines.append(f"last problem: {health.last_problem}")
    sys.stdout.write("".join(line + "\n" for line in lines))


def _box_well(health: TriggerHealth) -> bool:
    residual = health.clock_residual_us
    return health.interlock_closed is not False and (residual is None or residual <= WORST_CLOCK_US)


def run_sessions_verify_command(folder: Path, *, as_json: bool) -> None:
    """Prove a session whole."""
    with one_line_errors():
        check = verify_session(folder)
        document = {**dataclasses.asdict(check), "whole": check.whole}
        if as_json:
            _print_json(document)
        else:
            for finding in check.findings:
                sys.stdout.write(f"{finding.kind}: {finding.path}: {finding.text}\n")
            sys.stdout.write(
                f"{check.captures} captures, {check.files} files, {check.bytes / 1e6:.1f} MB: "
                f"{'whole' if check.whole else 'NOT whole'}\n"
            )
        if not check.whole:
            raise InputError(
                "session-not-whole",
                f"session {folder} is not whole: {len(check.findings)} findings",
                "see the list, and take a copy that is",
            )


def run_sessions_recover_command(folder: Path) -> None:
    """Put a session in order."""
    with one_line_errors(), Session.open(folder) as session:
        done = session.recovery
        for word, names in (
            ("committed", done.committed),
            ("set aside", done.set_aside),
            ("dropped", done.dropped),
        ):
            for name in names:
                sys.stdout.write(f"{word}: {name}\n")
        if not (done.committed or done.set_aside or done.dropped):
            sys.stdout.write("nothing to do\n")


def run_cameras_command(*, as_json: bool) -> None:
    """List what can be reached."""
    with one_line_errors():
        from rig.cameras.registry import discover_all

        found = discover_all()
        document = {"cameras": found.cameras, "problems": dict(found.problems)}
        if as_json:
            _print_json(document)
            return
        for camera in found.cameras:
            sys.stdout.write(f"{camera.backend}: {camera.id}  {camera.vendor} {camera.model}\n")
        for backend, why in found.problems.items():
            sys.stdout.write(f"{backend}: {why}\n")
        if not found.cameras:
            sys.stdout.write("no camera was found\n")


def run_fake_trigger_command(
    link: Path | None,
    port: int | None,
    serial_number: str,
    seed: int,
    faults: str,
    drift_ppm: float,
) -> None:
    """Be a box until interrupted."""
    with one_line_errors():
        from rig.trigger.fake.program import FakeOptions, run_fake

        run_fake(
            FakeOptions(
                serial_number=serial_number,
                link=link,
                port=port,
                seed=seed,
                faults=faults,
                drift_ppm=drift_ppm,
            ),
            _say,
        )


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def _told(report: Any) -> ProgressCallback:  # noqa: ANN401 - what show_progress gives
    def tell(progress: Progress, /) -> None:
        report(plain(progress))

    return tell


def _print_json(document: JSON) -> None:
    sys.stdout.write(json.dumps(plain(document), indent=2) + "\n")


def _show(document: JSON, *, as_json: bool) -> None:
    if as_json:
        _print_json(document)
        return
    for key, value in _lines(plain(document)):
        sys.stdout.write(f"{key}: {value}\n")


def _lines(document: JSON, prefix: str = "") -> list[tuple[str, str]]:
    lines: list[tuple[str, str]] = []
    for key, value in document.items():
        name = f"{prefix}{key}".replace("_", " ")
        if isinstance(value, dict):
            lines += _lines(value, f"{name}, ")
        elif isinstance(value, list):
            lines += [(name, str(item)) for item in value] or [(name, "none")]
        else:
            lines.append((name, "unknown" if value is None else str(value)))
    return lines


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
