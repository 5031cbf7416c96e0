"""``rigwright serve``."""

from __future__ import annotations

import sys
from pathlib import Path

from service.cli.running import one_line_errors
from service.logs import log, set_up_logging
from service.settings import read_settings


def run_serve_command(
    host: str | None, port: int | None, data: Path | None, stations: list[Path] | None
) -> None:
    """Serve until asked to stop."""
    with one_line_errors():
        settings = read_settings(host=host, port=port, data_dir=data, stations=stations)
        # After the settings, so that a mistake in them is told at once.
        from service.api.app import create_app
        from service.api.context import Service
        from service.kinds import KINDS
        from service.server import serve

        service = Service(settings, KINDS)
        try:
            serve(service, create_app(service), _say_where)
        finally:
            service.close()


def _say_where(url: str) -> None:
    # From here on everything that happens is a line of JSON on standard error.
    set_up_logging()
    log.propagate = True
    sys.stdout.write(f"Rigwright is at {url}/v1; stop it with Ctrl-C\n")
    sys.stdout.flush()
