"""Whole pages: one file each, everything inlined, nothing loaded from anywhere."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from importlib.resources import files
from string import Template
from typing import Any

from common.page.html import esc

STILL_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""A page without scripts."""

DRAWN_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)
"""A page with plotly figures, which compiles its shaders' glue, hence eval."""

_STILLED = ".held .still { display: block; } .held .canvas { display: none; }"


def style_sheet() -> str:
    """The style sheet of pages with figures: light and dark, on screen and in print."""
    return _part("style.css")


def still_page(title: str, body: str, style: str) -> str:
    """A page without scripts. ``body`` and ``style`` are HTML and CSS already, the title is not."""
    return _filled(title, body, style, STILL_POLICY, "")


def drawn_page(
    title: str,
    *,
    header: str,
    main: str,
    footer: str,
    style: str,
    figures: str,
    script: str,
    view: Mapping[str, Any],
) -> str:
    """A page whose ``script`` draws ``figures``, JSON, with plotly.

    ``header``, ``main`` and ``footer`` are HTML already. ``document.body.dataset`` gets ``view``,
    a JSON summary of what is drawn. Plotly is packed, which a browser undoes in 50 ms. Without
    scripts, and without WebGL, figures that have a still picture show it.
    """
    body = (
        f"<noscript><style>{_STILLED}</style></noscript>\n"
        f"<header>{header}</header>\n<main>{main}</main>\n<footer>{footer}</footer>\n"
        f'<script type="text/plain" id="plotly">{_packed_plotly()}</script>\n'
        f'<script type="text/plain" id="packed">{packed(figures)}</script>\n'
        f"<script>{Template(_part('drawn.js')).substitute(script=script)}</script>"
    )
    shown = esc(json.dumps(view, allow_nan=False))
    return _filled(title, body, style, DRAWN_POLICY, f' data-view="{shown}"')


def pack_ahead() -> None:
    """Have plotly packed in a thread, for :func:`drawn_page`, while the figures are made."""
    _plotly()


def _packed_plotly() -> str:
    try:
        return _plotly().result()
    except BaseException:
        _plotly.cache_clear()  # the next page tries anew
        raise


@cache
def _plotly() -> Future[str]:
    # Imported here: plotly costs a second, and only a page with figures needs it.
    from plotly.offline import get_plotlyjs

    program = get_plotlyjs()
    aside = ThreadPoolExecutor(1, thread_name_prefix="packing")
    packing = aside.submit(packed, program)
    aside.shutdown(wait=False)
    return packing


def packed(text: str) -> str:
    """A text, gzipped, in base64: what a page unpacks by ``DecompressionStream``."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def _filled(title: str, body: str, style: str, policy: str, attributes: str) -> str:
    return Template(_part("page.html")).substitute(
        policy=policy, title=esc(title), style=style, attributes=attributes, body=body
    )


def _part(name: str) -> str:
    return files("common.page").joinpath(name).read_text(encoding="utf-8")
