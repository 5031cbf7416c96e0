"""Around every request: an id, and a line in the log."""

from __future__ import annotations

import asyncio
import re
import secrets
import time
from collections.abc import Callable

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.logs import log, request_id

_SOUND_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")


class RequestLog:
    """ASGI middleware. A sound ``X-Request-ID`` of the client is kept, else one is made."""

    def __init__(self, app: ASGIApp, stopping: Callable[[], bool]) -> None:
        self._app = app
        self._stopping = stopping

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        given = Headers(scope=scope).get("x-request-id", "")
        own = given if _SOUND_ID.fullmatch(given) else secrets.token_hex(8)
        began_s, status = time.monotonic(), 0

        async def send_marked(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                headers["X-Request-ID"] = own
            await send(message)

        token = request_id.set(own)
        try:
            await self._app(scope, receive, send_marked)
        except asyncio.CancelledError:
            # A client that does not take its answer is left when the service stops; the server
            # would write that down as a fault of the program.
            if not self._stopping():
                raise
        finally:
            fields = {
                "method": scope["method"],
                "path": scope["path"],
                "status": status,
                "seconds": round(time.monotonic() - began_s, 4),
            }
            log.info("request", extra={"fields": fields})
            request_id.reset(token)
