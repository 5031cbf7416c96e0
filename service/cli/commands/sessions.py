"""``rigwright sessions``: looks after sessions."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.cli.options import JsonOption

if TYPE_CHECKING:
    from rig.acquisition.session.verify import SessionCheck

sessions = typer.Typer(name="sessions", help="Look after sessions.", no_args_is_help=True)


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
    run_sessions_recover_command(folder)


def run_sessions_verify_command(folder: Path, *, as_json: bool) -> None:
    """Prove a session whole."""
    from common.errors import InputError
    from common.words import counted
    from rig.acquisition.session.verify import verify_session
    from service.cli.output import print_json
    from service.cli.running import one_line_errors

    with one_line_errors():
        check = verify_session(folder)
        document = {**dataclasses.asdict(check), "whole": check.whole}
        if as_json:
            print_json(document)
        else:
            for finding in check.findings:
                sys.stdout.write(f"{finding.kind}: {finding.path}: {finding.text}\n")
            sys.stdout.write(
                f"{counted(check.captures, 'capture')}{_partial(check)}, "
                f"{counted(check.files, 'file')}, {check.bytes / 1e6:.1f} MB: "
                f"{'whole' if check.whole else 'NOT whole'}\n"
            )
        if not check.whole:
            raise InputError(
                "session-not-whole",
                f"session {folder} is not whole: {counted(len(check.findings), 'finding')}",
                "see the list, and take a copy that is",
            )


def _partial(check: SessionCheck) -> str:
    return f" ({check.partial} partial: pictures are missing)" if check.partial else ""


def run_sessions_recover_command(folder: Path) -> None:
    """Put a session in order."""
    from rig.acquisition.session.folder import Session
    from rig.acquisition.session.recovery import Recovery
    from service.cli.running import one_line_errors

    with one_line_errors(), Session.open(folder) as session:
        done = session.recovery
        for word, names in (
            ("committed", done.committed),
            ("set aside", done.set_aside),
            ("dropped", done.dropped),
            ("not of this program, kept", done.kept),
        ):
            for name in names:
                sys.stdout.write(f"{word}: {name}\n")
        if done == Recovery():
            sys.stdout.write("nothing to do\n")
