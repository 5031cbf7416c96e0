"""``rigwright serve``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer


def serve(
    host: Annotated[
        str | None,
        typer.Option(help="Address to listen on; 127.0.0.1 without it.", show_default=False),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            min=0, max=65535, help="Port; 8000 without it, 0 takes a free one.", show_default=False
        ),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder for everything the service keeps.", show_default=False
        ),
    ] = None,
    root_path: Annotated[
        str | None,
        typer.Option(
            metavar="/PREFIX",
            help="What a proxy puts before all paths; nothing without it.",
            show_default=False,
        ),
    ] = None,
    tls_cert: Annotated[
        Path | None,
        typer.Option(
            metavar="CERT.pem", help="Answer over HTTPS with this certificate.", show_default=False
        ),
    ] = None,
    tls_key: Annotated[
        Path | None,
        typer.Option(metavar="KEY.pem", help="The certificate's private key.", show_default=False),
    ] = None,
    station: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="STATION.toml",
            help="A rig to run; may be given several times.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Offer designs, and rigs that stand, over HTTP under /v1. The guide is docs/how-to/api.md.

    Example:  rigwright serve --port 8000 --data rigwright-data --station station.toml
    """
    run_serve_command(
        host=host,
        port=port,
        data_dir=data,
        stations=station,
        root_path=root_path,
        tls_cert=tls_cert,
        tls_key=tls_key,
    )


def run_serve_command(**given: object) -> None:
    """Serve until asked to stop. ``given``: settings that win over the environment."""
    from contextlib import ExitStack

    from service.cli.running import one_line_errors
    from service.settings import read_settings

    with one_line_errors(), ExitStack() as stack:
        settings = read_settings(**given)
        # After the settings, so that a mistake in them is told at once.
        from service.api.app import create_app
        from service.api.context import Service
        from service.client.notes import noted
        from service.kinds.queued import QUEUED
        from service.server import refuse_address, serve

        service = Service(settings, QUEUED, before_data=refuse_address)
        stack.callback(service.close)
        stations = [worker.station for worker in service.rigs.all()]

        def ready(url: str) -> None:
            at = f"{url}{settings.root_path}"
            stack.enter_context(noted(at, stations, settings.sessions_folder, settings.tls_cert))
            _say_where(url)

        serve(service, create_app(service), ready)


def _say_where(url: str) -> None:
    # From here on everything that happens is a line of JSON on standard error.
    from service.logs import log, set_up_logging

    set_up_logging()
    log.propagate = True
    sys.stdout.write(f"Rigwright is at {url}/v1; stop it with Ctrl-C\n")
    sys.stdout.flush()
