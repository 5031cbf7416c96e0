"""``rigwright backup`` and ``rigwright restore``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import DataOption


def backup(
    out: Annotated[
        Path, typer.Argument(metavar="BACKUP.zip", help="The file to write.", show_default=False)
    ],
    data: DataOption = None,
) -> None:
    """Write all that a service keeps, its sessions too, to one file. It may run meanwhile.

    Exit code: 0 done, 2 bad input, 4 done, but sessions are not whole and were taken as they are.

    Example:  rigwright backup monday.zip --data rigwright-data
    """
    from service.cli.output import NOT_WELL
    from service.cli.running import one_line_errors

    with one_line_errors():
        from service.backups import back_up
        from service.settings import read_settings

        settings = read_settings(data_dir=data)
        made = back_up(settings.data_dir, settings.sessions_folder, out)
        sys.stdout.write(
            f"{out}: {made.blobs} files and {made.sessions} sessions{_away(made.removed)}, "
            f"{made.size_bytes / 1e6:.1f} MB\n"
        )
        for name in made.damaged:
            sys.stdout.write(f"session {name} is not whole: see rigwright sessions verify\n")
    if made.damaged:
        raise typer.Exit(NOT_WELL)


def restore(
    backup: Annotated[
        Path, typer.Argument(metavar="BACKUP.zip", help="What backup wrote.", show_default=False)
    ],
    data: DataOption = None,
) -> None:
    """Write a backup to a new data folder, check every file, and bring it up to date.

    Example:  rigwright restore monday.zip --data rigwright-data
    """
    from service.cli.running import one_line_errors

    with one_line_errors():
        from service.backups import restore as write_back
        from service.settings import read_settings

        folder = read_settings(data_dir=data).data_dir
        found = write_back(backup, folder)
        sys.stdout.write(
            f"{folder}: {found.blobs} files and {found.sessions} sessions{_away(found.removed)}; "
            f"start it with rigwright serve --data {folder}\n"
        )


def _away(removed: int) -> str:
    return f" and {removed} deleted ones that can be restored" if removed else ""
