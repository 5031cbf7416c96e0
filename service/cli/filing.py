"""``rigwright sessions`` and ``rigwright cameras``."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

from common.errors import InputError
from rig.acquisition.cameras.registry import discover_all
from rig.acquisition.session.folder import Session
from rig.acquisition.session.verify import verify_session
from service.cli.output import print_json
from service.cli.running import one_line_errors


def run_sessions_verify_command(folder: Path, *, as_json: bool) -> None:
    """Prove a session whole."""
    with one_line_errors():
        check = verify_session(folder)
        document = {**dataclasses.asdict(check), "whole": check.whole}
        if as_json:
            print_json(document)
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
        found = discover_all()
        document = {"cameras": found.cameras, "problems": dict(found.problems)}
        if as_json:
            print_json(document)
            return
        for camera in found.cameras:
            sys.stdout.write(f"{camera.backend}: {camera.id}  {camera.vendor} {camera.model}\n")
        for backend, why in found.problems.items():
            sys.stdout.write(f"{backend}: {why}\n")
        if not found.cameras:
            sys.stdout.write("no camera was found\n")
