"""``rigwright rig``: looks at a rig that stands."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated

import typer

from common.progress import ignore_progress
from service.cli.options import (
    JsonOption,
    KeyOption,
    RigNameOption,
    ServedStationOption,
    ServerOption,
)
from service.kinds.defaults import SYNC_CAPTURES

if TYPE_CHECKING:
    from service.cli.owner import Asked
    from service.client.rig import RigSeen
    from service.kinds.rigs import RigTestOutcome

rig = typer.Typer(name="rig", help="Look at a rig that stands.", no_args_is_help=True)


@rig.command("check")
def rig_check(
    station: ServedStationOption = None,
    fire: Annotated[
        bool, typer.Option("--fire/--no-fire", help="Whether to measure the synchronisation.")
    ] = True,
    captures: Annotated[int, typer.Option(min=1, max=100, help="Captures to measure from.")] = (
        SYNC_CAPTURES
    ),
    write: Annotated[
        bool, typer.Option("--write", help="Write the delays it finds to the station file.")
    ] = False,
    server: ServerOption = None,
    key: KeyOption = None,
    name: RigNameOption = None,
    as_json: JsonOption = False,
) -> None:
    """Look at every device, then fire a few times and tell each camera's lag. Files nothing.

    Exit code: 0 all is well, 2 bad input, 4 something is not and nothing was written, 5 with
    --write: the exposures were not together, and new delays were written; check again.

    Example:  rigwright rig check --station station.toml --write
    """
    from service.cli.owner import Asked

    asked = Asked(station, server, key, name)
    run_rig_check_command(asked, captures if fire else 0, write=write, as_json=as_json)


WRITTEN = 5
"""Not well as it was, but new delays are in the file."""


def run_rig_check_command(asked: Asked, captures: int, *, write: bool, as_json: bool) -> None:
    """Self-test, then the synchronisation, as far as the devices are well."""
    from service.cli.output import NOT_WELL, print_json
    from service.cli.owner import rig_to_ask
    from service.cli.progress import show_progress
    from service.cli.running import cancel_on_signal, one_line_errors
    from service.kinds.rigs import RigTestRequest

    with one_line_errors(), ExitStack() as stack:
        there = stack.enter_context(rig_to_ask(asked))
        cancel = stack.enter_context(cancel_on_signal())
        report = stack.enter_context(show_progress())
        test = there.test(RigTestRequest(test="self-test"), ignore_progress, cancel)
        check: RigTestOutcome | None = None
        if test.ok and captures:
            sync = RigTestRequest(test="sync-check", captures=captures, adopt=write)
            check = there.test(sync, report, cancel)
        stack.close()
        if as_json:
            print_json(
                {
                    "self_test": _json(test),
                    "sync_check": None if check is None else _json(check),
                    "written": check is not None and check.adopted,
                }
            )
        else:
            _print_checks(test)
            if check is not None:
                _print_sync(check)
    well = test.ok and (check is None or check.ok)
    adopted = check is not None and check.adopted
    if not well and adopted:
        raise typer.Exit(WRITTEN)
    if not well or (write and check is not None and not adopted):
        raise typer.Exit(NOT_WELL)


@rig.command("status")
def rig_status(
    station: ServedStationOption = None,
    server: ServerOption = None,
    key: KeyOption = None,
    name: RigNameOption = None,
    as_json: JsonOption = False,
) -> None:
    """Tell how box and cameras are. Fires nothing.

    Exit code: 0 all is well, 2 bad input, 4 something is not.

    Example:  rigwright rig status --station station.toml
    """
    from service.cli.output import NOT_WELL, print_json
    from service.cli.owner import Asked, rig_to_ask
    from service.cli.running import one_line_errors

    with one_line_errors():
        with rig_to_ask(Asked(station, server, key, name)) as there:
            status = there.status()
        if as_json:
            print_json(status.model_dump(mode="json"))
        else:
            _print_status(status)
    if status.status not in ("ready", "busy"):
        raise typer.Exit(NOT_WELL)


@rig.command("abort")
def rig_abort(
    station: ServedStationOption = None,
    server: ServerOption = None,
    key: KeyOption = None,
    name: RigNameOption = None,
) -> None:
    """Take all outputs low now and end what the rig does, in the service that runs it.

    Where a command runs the rig, Ctrl-C there does the same.

    Example:  rigwright rig abort --station station.toml
    """
    from common.errors import NotFoundError
    from service.cli.owner import Asked, served_rig
    from service.cli.running import one_line_errors

    with one_line_errors(), served_rig(Asked(station, server, key, name)) as served:
        if served is None:
            raise NotFoundError(
                "service",
                "no service runs this rig",
                "press Ctrl-C where it is used, or name the service with --server",
            )
        sys.stdout.write(f"aborted; the rig is {served.rig.abort().status}\n")


def _print_status(status: RigSeen) -> None:
    lines = [f"{status.name}: {status.status}" + (f", {status.doing}" if status.doing else "")]
    if status.problem is not None:
        lines.append(f"problem: {status.problem.detail}")
    box = status.trigger
    if box is not None:
        interlock = {True: "closed", False: "OPEN", None: "none"}[box.interlock_closed]
        lines.append(f"trigger box: {box.state}, interlock {interlock}, {box.identity}")
        lines += [f"its last problem: {box.last_problem}"] if box.last_problem else []
    for camera in status.cameras:
        state = "connected" if camera.connected else "NOT connected"
        lines.append(f"{camera.name}: {state}" + (f", {camera.problem}" if camera.problem else ""))
    sys.stdout.write("".join(f"{line}\n" for line in lines))


_TOLD = {
    "self-test": {"test", "ok", "checks"},
    "sync-check": {"test", "ok", "verdicts", "faults", "lags", "timings", "why_not", "adopted"},
}
"""What belongs to a test: the rest of an outcome is empty."""


def _json(outcome: RigTestOutcome) -> dict[str, object]:
    return outcome.model_dump(mode="json", include=_TOLD[outcome.test])


def _print_checks(test: RigTestOutcome) -> None:
    for check in test.checks:
        sys.stdout.write(f"{'ok ' if check.ok else 'BAD'} {check.name}: {check.text}\n")


def _print_sync(check: RigTestOutcome) -> None:
    for number, verdict in enumerate(check.verdicts, 1):
        sys.stdout.write(f"capture {number}: {verdict.text}\n")
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
    told = "written to the station file" if check.adopted else "--write keeps these delays"
    sys.stdout.write(f"{told}\n")
