"""Around every request: a line in the audit log for what changes something or is refused."""

from __future__ import annotations

import time

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.door import OPERATION, address_of, name_of
from service.keys.audit import AuditLog
from service.logs import request_id

_REFUSALS = (401, 403, 421, 429)
_FLOOD_S = 1.0
"""Refusals for guessing come in masses; a line a second tells of them."""


class Audited:
    """ASGI middleware."""

    def __init__(self, app: ASGIApp, log: AuditLog) -> None:
        self._app = app
        self._log = log
        self._last_flood_s = -_FLOOD_S

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        status, made = 0, None

        async def send_seen(message: Message) -> None:
            nonlocal status, made
            if message["type"] == "http.response.start":
                status = message["status"]
                made = Headers(raw=message["headers"]).get("location")
            await send(message)

        try:
            await self._app(scope, receive, send_seen)
        finally:
            if scope["method"] not in ("GET", "HEAD", "OPTIONS") or status in _REFUSALS:
                self._note(scope, status, made)

    def _note(self, scope: Scope, status: int, made: str | None) -> None:
        if status == 429:
            now_s = time.monotonic()
            if now_s - self._last_flood_s < _FLOOD_S:
                return
            self._last_flood_s = now_s
        self._log.note(
            {
                "who": name_of(scope) or None,
                "from": address_of(scope),
                "method": scope["method"],
                "path": scope["path"],
                "operation": scope.get(OPERATION) or None,
                "answer": status,
                "made": made,
                "request_id": request_id.get(),
            }
        )
