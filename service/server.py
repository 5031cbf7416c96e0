"""The HTTP server process."""

from __future__ import annotations

import asyncio
import signal
import socket
import ssl
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import h11
import uvicorn
from fastapi import FastAPI
from uvicorn.protocols.http.h11_impl import H11Protocol

from common.errors import InputError
from common.files.reading import plain_size
from service.api.context import Service
from service.settings import Settings

_GRACE_S = 2
"""Open requests hear of the stop within a quarter of a second; this is for their last answers."""

HEADER_S = 10.0
"""How long the head of a request may take; a connection without one is let go."""


class _Http(H11Protocol):
    """Sends at once, and lets go of connections that never finish the head of a request."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        # asyncio does so for sockets that name their protocol only, which ours does not. Without it
        # the body waits for the head to be acknowledged, and that takes Linux 40 ms.
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._head_in_time = self.loop.call_later(HEADER_S, self._let_go)

    def handle_events(self) -> None:
        super().handle_events()
        begun = self.cycle is not None and not self.cycle.response_complete
        partial = self.conn.their_state is h11.IDLE and bool(self.conn.trailing_data[0])
        if begun or not partial:
            self._head_in_time.cancel()
        elif self._head_in_time.cancelled():
            self._head_in_time = self.loop.call_later(HEADER_S, self._let_go)

    def connection_lost(self, exc: Exception | None) -> None:
        self._head_in_time.cancel()
        super().connection_lost(exc)

    def _let_go(self) -> None:
        if not self.transport.is_closing():
            self.transport.close()


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
            scheme = "http" if self.config.ssl is None else "https"
            self._ready(f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}")

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._service.announce_stop()
        await super().shutdown(sockets)
        for connection in list(self.server_state.connections):
            # Its client takes nothing: what is still to be sent would be waited for without end.
            if connection.transport is not None:
                connection.transport.abort()
        await asyncio.sleep(0)


def serve(service: Service, app: FastAPI, ready: Callable[[str], None]) -> None:
    """Answer requests until the process is asked to stop; ``ready`` hears the address.

    Raises :class:`InputError` when the address cannot be listened on.
    """
    settings = service.settings
    tls = _certificate(settings.tls_cert, settings.tls_key)
    listening = _listen(settings.host, settings.port)
    config = uvicorn.Config(
        app,
        log_config=None,
        access_log=False,
        timeout_graceful_shutdown=_GRACE_S,
        lifespan="on",
        http=_Http,
    )
    config.load()
    config.ssl = tls
    with listening:
        asyncio.run(_Server(config, service, ready).serve([listening]))


def refuse_address(settings: Settings) -> None:
    """Raise what :func:`serve` would, before anything is made for it."""
    _certificate(settings.tls_cert, settings.tls_key)
    _listen(settings.host, settings.port).close()


def _certificate(cert: Path | None, key: Path | None) -> ssl.SSLContext | None:
    """What to answer over HTTPS with; None where HTTP is wanted."""
    if cert is None and key is None:
        return None
    if cert is None or key is None:
        raise InputError("tls", "a certificate goes with its key", "give --tls-cert and --tls-key")
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    try:
        for file in (cert, key):
            plain_size(file)
        # Nobody is there to type the password of a key that has one.
        context.load_cert_chain(cert, key, password="")
    except (OSError, ValueError) as error:
        why = getattr(error, "reason", None) or getattr(error, "strerror", None) or error
        raise InputError(
            "tls",
            f"{cert} and {key} are no certificate with its key ({why})",
            "give PEM files that belong together, the key without a password",
        ) from error
    return context


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
