"""``/`` and ``/page/…``: the files of the page, as they were shipped."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from fastapi import APIRouter, Response

from common.errors import NotFoundError

router = APIRouter(include_in_schema=False)

_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
"""Nothing inline runs, so that no name that somebody typed can; nothing leads elsewhere."""


@dataclass(frozen=True)
class Asset:
    """One shipped file."""

    content: bytes
    media_type: str


@cache
def assets() -> dict[str, Asset]:
    """All files of the page by name: what is asked for is looked up, never used as a path."""
    found = {}
    for entry in files("service.page.assets").iterdir():
        suffix = "." + entry.name.rpartition(".")[2]
        if suffix in _TYPES:
            found[entry.name] = Asset(entry.read_bytes(), _TYPES[suffix])
    return found


@router.get("/")
def read_page() -> Response:
    """The page itself."""
    return _answer("index.html")


@router.get("/page/{name}")
def read_asset(name: str) -> Response:
    """A part of the page."""
    return _answer(name)


def _answer(name: str) -> Response:
    asset = assets().get(name)
    if asset is None:
        raise NotFoundError("path", f"the page has no part {name!r}", "begin at /")
    # Asked for again each time: a service that was brought up to date shows its new page at once.
    # Browsers ask for the icon with each view.
    kept = "max-age=3600" if name.endswith(".svg") else "no-cache"
    headers = {"Cache-Control": kept, "Content-Security-Policy": POLICY}
    return Response(asset.content, media_type=asset.media_type, headers=headers)
