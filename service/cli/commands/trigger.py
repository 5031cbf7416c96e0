"""``rigwright trigger``: looks at a trigger box."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.cli.options import JsonOption, KeyOption

if TYPE_CHECKING:
    from common.errors import InputError
    from rig.acquisition.trigger.box import TriggerBox
    from service.stations.status import TriggerStatus

trigger = typer.Typer(name="trigger", help="Look at a trigger box.", no_args_is_help=True)


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
    key: KeyOption = None,
    as_json: JsonOption = False,
) -> None:
    """Ask a trigger box who and how it is: identity, interlock, clock, round trips. Fires nothing.

    Exit code: 0 all is well, 2 bad input, 4 it does not answer or something is not well.

    Example:  rigwright trigger selftest --url /dev/ttyACM0
    """
    run_trigger_selftest_command(url, station, key, as_json=as_json)


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
    key: KeyOption = None,
) -> None:
    """Let a box leave its fault, once its interlock is closed again. Fires nothing.

    Example:  rigwright trigger reset --url /dev/ttyACM0
    """
    run_trigger_reset_command(url, station, key)


WORST_CLOCK_US = 500.0
"""A worse fit of the box's clock than this says that its line is disturbed."""


def run_trigger_selftest_command(
    url: str | None, station: Path | None, key: str | None, *, as_json: bool
) -> None:
    """Tell how a box is."""
    from service.cli.output import NOT_WELL, print_json
    from service.cli.running import one_line_errors

    with one_line_errors():
        told = _box_of_service(station, key) or _box_opened(url, station)
        well = _box_well(told)
        if as_json:
            health = told.model_dump(mode="json")
            capabilities = health.pop("capabilities")
            print_json({"ok": well, "health": health, "capabilities": capabilities})
        else:
            _print_box(told)
    if not well:
        raise typer.Exit(NOT_WELL)


def run_trigger_reset_command(url: str | None, station: Path | None, key: str | None) -> None:
    """Let a box leave its fault."""
    from service.cli.running import one_line_errors

    with one_line_errors():
        told = _box_of_service(station, key, reset=True)
        if told is not None:
            state = told.state
        else:
            with _open_box(url, station) as box:
                box.reset()
                state = box.health().state
        sys.stdout.write(f"the box is {state}\n")


def _box_of_service(
    station: Path | None, key: str | None, *, reset: bool = False
) -> TriggerStatus | None:
    """The box, where a service runs the rig of the station; None where none does."""
    if station is None:
        return None
    from service.cli.owner import Asked, served_rig

    with served_rig(Asked(station, key=key)) as served:
        if served is None:
            return None
        told = served.rig.reset() if reset else served.rig.status()
    if told.trigger is None:
        raise _no_box() if told.problem is None else told.problem.error()
    return told.trigger


def _box_opened(url: str | None, station: Path | None) -> TriggerStatus:
    from common.files.plain import plain
    from service.stations.status import TriggerStatus

    with _open_box(url, station) as box:
        return TriggerStatus.model_validate(
            {**plain(box.health()), "capabilities": plain(box.capabilities)}
        )


def _no_box() -> InputError:
    from common.errors import InputError

    return InputError("box", "the station has no trigger box", "add [trigger] to its file")


@contextmanager
def _open_box(url: str | None, station: Path | None) -> Iterator[TriggerBox]:
    from common.errors import InputError
    from rig.acquisition.station.spec import TriggerPlan
    from rig.acquisition.station.stationfile import read_station
    from rig.devices.station import StationDevices

    if (url is None) == (station is None):
        raise InputError("box", "no box, or two, were named", "give --url or --station")
    plan = TriggerPlan("rigwright", url) if url else read_station(station or Path()).trigger
    if plan is None:
        raise _no_box()
    with ExitStack() as stack:
        devices = StationDevices()
        stack.callback(devices.close)
        box = devices.make_box(plan)
        stack.callback(box.close)
        box.open()
        yield box


def _print_box(health: TriggerStatus) -> None:
    interlock = {True: "closed", False: "OPEN", None: "none"}[health.interlock_closed]
    lines = [
        f"{health.identity}, serial number {health.serial_number}, firmware {health.firmware}",
        f"state: {health.state}; interlock: {interlock}; started {health.boots} times",
    ]
    can = health.capabilities
    if can is not None:
        lines.append(
            f"{can.outputs} outputs, steps of {can.tick_us:g} us, delays up to "
            f"{can.max_delay_us / 1e6:g} s, pulses up to {can.max_width_us / 1e6:g} s, "
            f"bursts of up to {can.max_shots}"
        )
    if health.round_trip_p50_ms is not None:
        lines.append(f"round trip: {health.round_trip_p50_ms:.2f} ms median")
    if health.clock_residual_us is not None:
        lines.append(f"its clock is known to {health.clock_residual_us:.0f} us")
    if health.last_problem:
        lines.append(f"last problem: {health.last_problem}")
    sys.stdout.write("".join(line + "\n" for line in lines))


def _box_well(health: TriggerStatus) -> bool:
    residual = health.clock_residual_us
    return health.interlock_closed is not False and (residual is None or residual <= WORST_CLOCK_US)
