"""The command ``rigwright``.

Only what the help needs is imported here; a command imports its own tools when it runs, and its
options are read when it is asked for (``service.cli.lazy``).
"""

from __future__ import annotations

import io
import os
import sys
from typing import Annotated

import typer

from common.threads import ONE_BLAS_THREAD
from service.cli.commands.accept import accept
from service.cli.commands.backup import backup, restore
from service.cli.commands.calibrate import calibrate
from service.cli.commands.cameras import cameras
from service.cli.commands.capture import capture
from service.cli.commands.catalogue import catalogue
from service.cli.commands.check import check
from service.cli.commands.compare import compare
from service.cli.commands.demo import demo
from service.cli.commands.design import design
from service.cli.commands.evaluate import evaluate
from service.cli.commands.export import export
from service.cli.commands.fake_trigger import fake_trigger
from service.cli.commands.keys import keys
from service.cli.commands.plan import plan
from service.cli.commands.practice import practice
from service.cli.commands.recognise import recognise
from service.cli.commands.reconstruct import reconstruct
from service.cli.commands.rig import rig
from service.cli.commands.scan import scan
from service.cli.commands.serve import serve
from service.cli.commands.sessions import sessions
from service.cli.commands.study import study
from service.cli.commands.targets import targets
from service.cli.commands.trial import trial
from service.cli.commands.trigger import trigger
from service.cli.lazy import LazyCommands, group_of

COMMANDS = LazyCommands(
    *(demo, scan, design, evaluate, study, plan, catalogue, export),
    *(targets, calibrate, check, accept),
    *(reconstruct, compare, trial),
    *(practice, capture, cameras, fake_trigger, serve, backup, restore),
    *(rig, trigger, sessions, keys, recognise),
)

app = typer.Typer(
    name="rigwright",
    cls=group_of(COMMANDS),
    help="Designs and runs multi-camera rigs that photograph a face from all sides at one instant.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    # Panels and colours would take longer to load than all the rest.
    rich_markup_mode=None,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from common.version import program_version

        typer.echo(f"rigwright {program_version()}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Designs multi-camera rigs that photograph a face from all sides at one instant."""


def main() -> None:
    """Run the command line."""
    for name, count in ONE_BLAS_THREAD.items():
        os.environ.setdefault(name, count)
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Names of files need not be text, and are printed all the same, as errors are.
        sys.stdout.reconfigure(errors="backslashreplace")
    app()
