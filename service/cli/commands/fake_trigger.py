"""``rigwright fake-trigger``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer


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
        str, typer.Option(help="Faults and their rates; docs/explanation/trigger.md lists them.")
    ] = "",
    drift_ppm: Annotated[float, typer.Option(help="How much too fast its clock runs.")] = 0.0,
    esper: Annotated[
        bool, typer.Option("--esper", help="Be an ESPER TriggerBox; of the rest it has its name.")
    ] = False,
) -> None:
    """Be a trigger box, for rigs without one: it speaks the protocol and fires nothing real.

    Example:  rigwright fake-trigger --link box
    """
    run_fake_trigger_command(link, port, serial_number, seed, faults, drift_ppm, esper=esper)


def run_fake_trigger_command(
    link: Path | None,
    port: int | None,
    serial_number: str,
    seed: int,
    faults: str,
    drift_ppm: float,
    *,
    esper: bool = False,
) -> None:
    """Be a box until interrupted."""
    from rig.acquisition.trigger.fake.program import FakeOptions, run_fake
    from service.cli.running import one_line_errors

    with one_line_errors():
        run_fake(
            FakeOptions(
                serial_number=serial_number,
                link=link,
                port=port,
                seed=seed,
                faults=faults,
                drift_ppm=drift_ppm,
                esper=esper,
            ),
            _say,
        )


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()
