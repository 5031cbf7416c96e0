"""Addresses as clients see them: behind a proxy the service has a prefix in front of its paths."""

from __future__ import annotations

from contextvars import ContextVar

from starlette.types import ASGIApp, Receive, Scope, Send

_prefix: ContextVar[str] = ContextVar("prefix", default="")


def at(path: str) -> str:
    """The address of a path of this service, for the request that is being answered."""
    return f"{_prefix.get()}{path}"


def own_path(scope: Scope) -> str:
    """The path that is asked for, without the prefix."""
    path: str = scope["path"]
    prefix: str = scope.get("root_path", "")
    return path[len(prefix) :] if prefix and path.startswith(f"{prefix}/") else path


class Prefix:
    """ASGI middleware: puts ``prefix`` before all addresses, whether the proxy keeps it or not.

    ``prefix`` is empty or begins with a slash and does not end with one.
    """

    def __init__(self, app: ASGIApp, prefix: str) -> None:
        self._app = app
        self._prefix = prefix

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        path: str = scope["path"]
        if not path.startswith(f"{self._prefix}/"):
            path = f"{self._prefix}{path}"
        token = _prefix.set(self._prefix)
        try:
            # In place: who logs the request wants to know which route it took.
            scope.update(path=path, root_path=self._prefix)
            await self._app(scope, receive, send)
        finally:
            _prefix.reset(token)
