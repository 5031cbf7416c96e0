"""Nothing is sent twice: answers have an entity tag; who has it hears 304 (RFC 9110)."""

from __future__ import annotations

import hashlib
from pathlib import Path

from fastapi.responses import FileResponse, Response
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_KEPT = ("etag", "cache-control", "vary", "content-location", "x-request-id")
"""What RFC 9110 wants in a 304, and who asked."""


def is_known(scope: Scope, tag: str) -> bool:
    """Whether the client has said that it has the answer with this tag."""
    given = ",".join(Headers(scope=scope).getlist("if-none-match"))
    known = [one.strip().removeprefix("W/") for one in given.split(",")]
    return given.strip() == "*" or tag in known


class StoredFile(FileResponse):
    """A file of known content, which is not read where the client has it."""

    def __init__(
        self, path: Path, media_type: str | None, sha256: str, status_code: int = 200
    ) -> None:
        super().__init__(path, status_code, media_type=media_type, headers={"ETag": f'"{sha256}"'})

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer with the file, or with 304."""
        tag = self.headers["etag"]
        if is_known(scope, tag):
            await Response(status_code=304, headers={"ETag": tag})(scope, receive, send)
            return
        await super().__call__(scope, receive, send)


class Conditional:
    """ASGI middleware: gives answers that are whole in memory a tag of their content."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http" or scope["method"] != "GET":
            await self._app(scope, receive, send)
            return
        held: Message | None = None

        async def send_tagged(message: Message) -> None:
            nonlocal held
            if message["type"] == "http.response.start" and _is_document(message):
                held = message
                return
            if held is not None:
                start, held = held, None
                if not message.get("more_body", False):
                    start, message = _tagged(scope, start, message)
                await send(start)
            await send(message)

        await self._app(scope, receive, send_tagged)


def _is_document(start: Message) -> bool:
    headers = Headers(raw=start["headers"])
    # What is made as it is sent has no length, or more than one message of body.
    return start["status"] == 200 and "content-length" in headers and "etag" not in headers


def _tagged(scope: Scope, start: Message, body: Message) -> tuple[Message, Message]:
    tag = f'"{hashlib.sha256(body.get("body", b"")).hexdigest()}"'
    MutableHeaders(scope=start)["ETag"] = tag
    if not is_known(scope, tag):
        return start, body
    kept = [pair for pair in start["headers"] if pair[0].decode("latin-1").lower() in _KEPT]
    return {**start, "status": 304, "headers": kept}, {**body, "body": b""}
