"""``rigwright rig``: looks at a rig that stands."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.cli.options import JsonOption, StationOption
from service.kinds.defaults import SYNC_CAPTURES

if TYPE_CHECKING:
    from service.kinds.rigs import RigTestOutcome

rig = typer.Typer(name="rig", help="Look at a rig that stands.", no_args_is_help=True)


@rig.command("check")
def rig_check(
    station: StationOption,
    fire: Annotated[
        bool, typer.Option("--fire/--no-fire", help="Whether to measure the synchronisation.")
    ] = True,
    captures: Annotated[int, typer.Option(min=1, max=100, help="Captures to measure from.")] = (
        SYNC_CAPTURES
    ),
    write: Annotated[
        bool, typer.Option("--write", help="Write the delays it finds to the station file.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Look at every device, then fire a few times and tell each camera's lag. Files nothing.

    Exit code: 0 all is well, 2 bad input, 4 something is not and nothing was written, 5 with
    --write: the exposures were not together, and new delays were written; check again.

    Example:  rigwright rig check --station station.toml --write
    """
    run_rig_check_command(station, captures if fire else 0, write=write, as_json=as_json)


WRITTEN = 5
"""Not well as it was, but new delays are in the file."""


def run_rig_check_command(station: Path, captures: int, *, write: bool, as_json: bool) -> None:
    """Self-test, then the synchronisation, as far as the devices are well."""
    from rig.acquisition.station.delays import write_timings
    from rig.acquisition.station.stationfile import read_station
    from rig.devices.station import open_station
    from service.cli.output import NOT_WELL, print_json
    from service.cli.progress import show_progress
    from service.cli.running import cancel_on_signal, one_line_errors
    from service.stations.jobs import self_test_outcome, sync_outcome

    with one_line_errors(), ExitStack() as stack:
        opened = stack.enter_context(open_station(read_station(station)))
        test = self_test_outcome(opened.self_test())
        check: RigTestOutcome | None = None
        if test.ok and captures:
            cancel = stack.enter_context(cancel_on_signal())
            report = stack.enter_context(show_progress())
            measured = opened.sync_check(captures, progress=report, cancel=cancel)
            written = write and measured.timings is not None
            if write and measured.timings is not None:
                write_timings(station, measured.timings)
            check = sync_outcome(measured, adopted=written)
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


def _json(outcome: RigTestOutcome) -> dict[str, object]:
    return outcome.model_dump(mode="json", exclude_unset=True)


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
