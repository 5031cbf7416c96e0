"""The HTTP server process."""

from __future__ import annotations

import asyncio
import signal
import socket
from collections.abc import Callable
from types import FrameType

import uvicorn
from fastapi import FastAPI

from common.errors import InputError
from service.api.context import Service

_GRACE_S = 5


class _Server(uvicorn.Server):
    """Ends event streams before it waits for connections to close: they would never close."""

    def __init__(
        self, config: uvicorn.Config, service: Service, ready: Callable[[str], None]
    ) -> None:
        super().__init__(config)
        self._service = service
        self._ready = ready

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        # The inherited one sends the signal to the process again after the shutdown, which would
        # end it before the store is closed.
        del frame
        if self.should_exit and sig == signal.SIGINT:
            self.force_exit = True
        self.should_exit = True

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started and sockets:
            host, port = sockets[0].getsockname()[:2]
            self._ready(f"http://{f'[{host}]' if ':' in host else host}:{port}")

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._service.announce_stop()
        await super().shutdown(sockets)


def serve(service: Service, app: FastAPI, ready: Callable[[str], None]) -> None:
    """Answer requests until the process is asked to stop; ``ready`` hears the address.

    Raises :class:`InputError` when the address cannot be listened on.
    """
    settings = service.settings
    listening = _listen(settings.host, settings.port)
    config = uvicorn.Config(
        app, log_config=None, access_log=False, timeout_graceful_shutdown=_GRACE_S, lifespan="on"
    )
    with listening:
        asyncio.run(_Server(config, service, ready).serve([listening]))


def _listen(host: str, port: int) -> socket.socket:
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        return socket.create_server((host, port), family=family, backlog=128)
    except (OSError, OverflowError) as error:
        raise InputError(
            "address",
            f"cannot listen on {host} port {port} ({getattr(error, 'strerror', None) or error})",
            "choose another --host or --port",
        ) from error
