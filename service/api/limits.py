"""Ends to what one request may take: bytes of its body, and time until they are here."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from common.errors import InputError, InternalError, TooLargeError
from service.api.addresses import own_path
from service.api.errors import Refusal, answer
from service.api.gate import UPLOADS

LARGEST_BODY_BYTES = 64 << 20
"""A design document with its thousands of points has a few megabytes."""

PAUSE_S = 20.0
"""How long a body may pause."""

_LEAST_BYTES_PER_S = 1000.0
"""A body that comes slower on the whole is meant to hold the connection."""

_LOOK_EVERY_S = 0.25


class BodyLimits:
    """ASGI middleware: for every body, of whatever type, before it is read.

    Files that are uploaded are written to disk as they come and have limits of their own bytes,
    but not of their own time. ``stopping`` says whether the service ends: then no body is waited
    for, nor a new request begun.
    """

    def __init__(self, app: ASGIApp, stopping: Callable[[], bool], pause_s: float) -> None:
        self._app = app
        self._stopping = stopping
        self._pause_s = pause_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        if self._stopping():
            await answer(_stops())(scope, receive, send)
            return
        limit = None if own_path(scope) in UPLOADS else LARGEST_BODY_BYTES
        announced = Headers(scope=scope).get("content-length", "")
        if limit is not None and announced.isdecimal() and int(announced) > limit:
            await answer(_too_large(limit))(scope, receive, send)
            return
        body = _Body(receive, limit, self._stopping, self._pause_s)
        await self._app(scope, body.receive, send)


class _Body:
    """One request's body on its way in."""

    def __init__(
        self, receive: Receive, limit: int | None, stopping: Callable[[], bool], pause_s: float
    ) -> None:
        self._receive = receive
        self._limit = limit
        self._stopping = stopping
        self._pause_s = pause_s
        self._began_s = time.monotonic()
        self._bytes = 0
        self._whole = False

    async def receive(self) -> Message:
        """The next message. Raises what the request is to be answered with."""
        if self._whole:
            # What comes now says that the client has gone: it may take as long as it likes.
            return await self._receive()
        message = await self._in_time()
        self._bytes += len(message.get("body", b""))
        if self._limit is not None and self._bytes > self._limit:
            raise Refusal(_too_large(self._limit))
        self._whole = not message.get("more_body", False)
        if not self._whole:
            self._go_on()
        return message

    async def _in_time(self) -> Message:
        waiting = asyncio.ensure_future(self._receive())
        last_s = time.monotonic()
        try:
            while not waiting.done():
                await asyncio.wait([waiting], timeout=_LOOK_EVERY_S)
                if waiting.done():
                    break
                self._go_on()
                if time.monotonic() - last_s > self._pause_s:
                    raise Refusal(_too_slow())
            return waiting.result()
        finally:
            waiting.cancel()

    def _go_on(self) -> None:
        """Whether more of a body is worth waiting for, also where it drips and never pauses.

        Raises what the request is to be answered with.
        """
        if self._stopping():
            raise Refusal(_stops())
        late_s = time.monotonic() - self._began_s - self._pause_s
        if late_s > 0.0 and self._bytes < _LEAST_BYTES_PER_S * late_s:
            raise Refusal(_too_slow())


def _too_slow() -> InputError:
    return InputError("body-slow", "the body of the request does not come", "send it again")


def _stops() -> InternalError:
    return InternalError("stopping", "the service is stopping", "ask again in a moment")


def _too_large(limit: int) -> TooLargeError:
    return TooLargeError(
        "body",
        f"the body is larger than the {limit >> 20} MiB that a request may have",
        "send less, a design without its points for example",
    )
