"""Who may ask: nothing that a foreign web page in the lab's browser can send changes anything.

That the service answers this machine only, or whoever has a key, would be no protection where a
page that somebody visits can have the browser ask. Three doors are shut: a foreign name that was
pointed at this address (the ``Host`` header tells), a page of another origin (``Origin`` tells),
and requests that a browser sends for any page without asking first (a form, or text): what changes
something must be JSON, a file's own media type, or carry the header ``X-Rigwright``.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Collection
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from common.errors import InputError
from service.api.addresses import own_path
from service.api.errors import answer

HEADER = "x-rigwright"
UPLOADS = ("/v1/scans", "/v1/picture-sets")
"""Paths that take a file as it is."""

_CHANGING = ("POST", "PUT", "PATCH", "DELETE")
_SENT_WITHOUT_ASKING = (
    "text/plain",
    "application/x-www-form-urlencoded",
    "multipart/form-data",
)
"""A browser sends these to any address for any page (the Fetch standard's safe-listed types)."""

_PROTECTIVE = {
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "X-Frame-Options": "SAMEORIGIN",
    "Referrer-Policy": "no-referrer",
}
_NO_CONTENT_RUNS = "default-src 'none'; frame-ancestors 'self'"
_PAGES = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob:; style-src 'unsafe-inline';"
    " img-src 'self' data: blob:; font-src data:; connect-src 'self' data: blob:;"
    " worker-src blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""Reports are pages of one file: their scripts and pictures are in them."""


class Gate:
    """ASGI middleware. ``hosts``: names allowed besides addresses; ``origins``: other pages."""

    def __init__(self, app: ASGIApp, hosts: Collection[str], origins: Collection[str]) -> None:
        self._app = app
        self._hosts = frozenset(host.lower() for host in hosts)
        self._origins = frozenset(origin.lower().rstrip("/") for origin in origins)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_protected(message: Message) -> None:
            if message["type"] == "http.response.start":
                _protect(MutableHeaders(scope=message), unchanged=message["status"] == 304)
            await send(message)

        refusal = self._refusal(scope["method"], own_path(scope), Headers(scope=scope))
        if refusal is not None:
            await answer(refusal)(scope, receive, send_protected)
            return
        await self._app(scope, receive, send_protected)

    def _refusal(self, method: str, path: str, headers: Headers) -> InputError | None:
        host = headers.get("host", "")
        if not self._known(host):
            return InputError(
                "host",
                f"this service is not called {_short(host)}",
                "use its address, or allow the name with RIGWRIGHT_ALLOWED_HOSTS",
            )
        if method not in _CHANGING:
            return None
        origin = headers.get("origin")
        if origin is not None and not self._allowed(origin, host):
            return InputError(
                "origin",
                f"pages of {_short(origin)} may not change anything here",
                "allow the page's origin with RIGWRIGHT_ALLOWED_ORIGINS",
            )
        return wrong_type(method, path, headers)

    def _known(self, host: str) -> bool:
        name = _name_of(host)
        if name is None:
            return False
        return name in self._hosts or _is_address(name)

    def _allowed(self, origin: str, host: str) -> bool:
        given = origin.lower()
        return given in self._origins or urlsplit(given).netloc == host.lower() != ""


def wrong_type(method: str, path: str, headers: Headers) -> InputError | None:
    """What is wrong with the media type of a request to ``path``; None for one that may come."""
    if method != "POST":
        # A browser asks before it sends these for a page, and nothing here reads their body.
        return None
    given = headers.get("content-type", "").split(";")[0].strip().lower()
    upload = path in UPLOADS
    if upload and (given in _SENT_WITHOUT_ASKING or given.endswith("json")):
        return InputError(
            "media-type",
            f"a file is not sent as {given}",
            "send its bytes with Content-Type: application/octet-stream, as curl does with -H and "
            "--data-binary @FILE",
        )
    if not upload and given and not given.endswith(("/json", "+json")):
        return InputError(
            "media-type", f"the body is {_short(given)}", "send Content-Type: application/json"
        )
    if not given and HEADER not in headers:
        return InputError(
            "unmarked",
            "any web page could have sent this request",
            "send the header X-Rigwright: 1, or Content-Type: application/json",
        )
    return None


def _name_of(host: str) -> str | None:
    """The name in a ``Host`` header, without its port; None where there is none."""
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None


def _is_address(name: str) -> bool:
    # A page can have its own name lead to this machine, but not a number.
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _short(given: str) -> str:
    return repr(given[:80])


def _protect(headers: MutableHeaders, *, unchanged: bool) -> None:
    for name, value in _PROTECTIVE.items():
        headers.setdefault(name, value)
    if unchanged:
        # A browser takes what is here in place of what it has kept, and of what kind that is only
        # the first answer told.
        return
    page = headers.get("content-type", "").startswith("text/html")
    headers.setdefault("Content-Security-Policy", _PAGES if page else _NO_CONTENT_RUNS)
    headers.setdefault("Cache-Control", "no-cache")
