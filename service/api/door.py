"""Who may come in: a key as bearer, or the cookie of a browser that signed in.

Stands before bodies are read. A service of this machine alone has no keys, and lets everybody in.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie

from fastapi import APIRouter
from starlette.datastructures import Headers
from starlette.routing import BaseRoute, Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from common.errors import InputError, RigwrightError
from service.api.errors import answer
from service.api.gate import HEADER
from service.api.scopes import OPEN, needed_scope
from service.keys.ring import KeyRing, Visitor

COOKIE = "rigwright"
VISITOR = "rigwright.visitor"
OPERATION = "rigwright.operation"
_LOOK_EVERY_S = 0.5
"""How soon a stream ends after its key: a look is one ``stat``."""


class Door:
    """ASGI middleware. ``ring``: the keys, or None where none are asked for."""

    def __init__(self, app: ASGIApp, ring: KeyRing | None, routers: Iterable[APIRouter]) -> None:
        self._app = app
        self._ring = ring
        self._routes: list[BaseRoute] = [route for router in routers for route in router.routes]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        operation = self._operation(scope)
        scope[OPERATION] = operation
        if self._ring is None or operation in OPEN:
            await self._app(scope, receive, send)
            return
        try:
            visitor = self._visitor(self._ring, scope, operation)
        except RigwrightError as refusal:
            await answer(refusal)(scope, receive, send)
            return
        scope[VISITOR] = visitor
        await _WhileValid(self._ring, visitor, receive, send).run(self._app, scope)

    def _operation(self, scope: Scope) -> str:
        for route in self._routes:
            match, _ = route.matches(scope)
            if match is Match.FULL:
                return str(getattr(route, "name", ""))
        return ""

    @staticmethod
    def _visitor(ring: KeyRing, scope: Scope, operation: str) -> Visitor:
        visitor = who_asks(ring, scope)
        scope[VISITOR] = visitor
        needed = needed_scope(scope["method"], operation)
        if not visitor.key.scope.covers(needed):
            raise InputError(
                "key-scope",
                f"the key {visitor.key.name!r} may {visitor.key.scope}, and this needs {needed}",
                f"ask with a key of scope {needed}",
            )
        return visitor


def who_asks(ring: KeyRing, scope: Scope) -> Visitor:
    """The visitor behind a request. Raises what the request is to be answered with."""
    headers = Headers(scope=scope)
    kind, _, token = headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer" and token:
        return ring.with_key(token.strip(), address_of(scope))
    cookie = _cookie(headers)
    if not cookie:
        raise InputError(
            "key-needed",
            "this service answers only whoever has a key",
            "send Authorization: Bearer KEY, or sign in on the page",
        )
    if scope["method"] != "GET" and not ("origin" in headers and HEADER in headers):
        # A browser adds the cookie to whatever any page sends; these two only to our own page's.
        raise InputError(
            "cookie-bare",
            "a sign-in alone changes nothing here",
            "use the service's own page, or send a key as Authorization: Bearer KEY",
        )
    return ring.signed_in(cookie)


def name_of(scope: Scope) -> str:
    """Whose key a request came with; empty where none was asked for, or none was right."""
    visitor = scope.get(VISITOR)
    return visitor.key.name if isinstance(visitor, Visitor) else ""


def address_of(scope: Scope) -> str:
    """Where a request comes from."""
    return str((scope.get("client") or ("unknown",))[0])


def _cookie(headers: Headers) -> str:
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return ""
    return "" if found is None else found.value


class _WhileValid:
    """One answer, which ends when its visitor's key does: event streams go on for hours."""

    def __init__(self, ring: KeyRing, visitor: Visitor, receive: Receive, send: Send) -> None:
        self._ring = ring
        self._visitor = visitor
        self._receive = receive
        self._send = send
        self._stream = False
        self._over = False

    async def run(self, app: ASGIApp, scope: Scope) -> None:
        """Answer the request."""
        await app(scope, self._received, self._sent)
        if self._stream and not self._over:
            await self._send({"type": "http.response.body", "body": b"", "more_body": False})

    async def _received(self) -> Message:
        while True:
            try:
                return await asyncio.wait_for(self._receive(), _LOOK_EVERY_S)
            except TimeoutError:
                if self._stream and not self._ring.still(self._visitor):
                    return {"type": "http.disconnect"}

    async def _sent(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            kind = Headers(raw=message["headers"]).get("content-type", "")
            self._stream = kind.startswith("text/event-stream")
        elif not message.get("more_body", False):
            self._over = True
        await self._send(message)
