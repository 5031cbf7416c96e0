"""``rigwright cameras``."""

from __future__ import annotations

import sys

from service.cli.options import JsonOption


def cameras(as_json: JsonOption = False) -> None:
    """List the cameras that can be reached now, by every library that is installed.

    Example:  rigwright cameras
    """
    run_cameras_command(as_json=as_json)


def run_cameras_command(*, as_json: bool) -> None:
    """List what can be reached."""
    from rig.devices.registry import discover_all
    from service.cli.output import print_json
    from service.cli.running import one_line_errors

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
