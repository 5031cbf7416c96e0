"""Whole pages: one file each, everything inlined, nothing loaded from anywhere."""

from __future__ import annotations

import json
from collections.abc import Mapping
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
    a JSON summary of what is drawn.
    """
    # Imported here: plotly costs a second, and only a page with figures needs it.
    from plotly.offline import get_plotlyjs

    body = (
        f"<header>{header}</header>\n<main>{main}</main>\n<footer>{footer}</footer>\n"
        f"<script>{get_plotlyjs()}</script>\n"
        f'<script type="application/json" id="figures">{in_script(figures)}</script>\n'
        f"<script>{script}</script>"
    )
    shown = esc(json.dumps(view, allow_nan=False))
    return _filled(title, body, style, DRAWN_POLICY, f' data-view="{shown}"')


def in_script(text: str) -> str:
    """JSON that may stand inside a script element, whatever names it holds."""
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _filled(title: str, body: str, style: str, policy: str, attributes: str) -> str:
    return Template(_part("page.html")).substitute(
        policy=policy, title=esc(title), style=style, attributes=attributes, body=body
    )


def _part(name: str) -> str:
    return files("common.page").joinpath(name).read_text(encoding="utf-8")
