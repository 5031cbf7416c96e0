"""HTML by hand, safely: every text that is not ours goes through :func:`esc`."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence

from common.words import percent_cut


def esc(text: object) -> str:
    """``text`` as it may stand in HTML, in attributes too."""
    return html.escape(str(text), quote=True)


def figure_text(value: float, digits: int = 3) -> str:
    """A number for people: ``digits`` significant ones, a dash for none, the infinity sign."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞"
    if value == 0.0:
        return "0"
    whole = len(str(int(abs(value)))) if abs(value) >= 1.0 else 0
    if whole == 0 and abs(value) < 1e-4:
        return f"{value:.1e}".replace("-", "−")
    decimals = max(0, digits - whole) if whole else digits - 1 - math.floor(math.log10(abs(value)))
    return f"{value:.{decimals}f}".replace("-", "−")


def percent(share: float) -> str:
    """A share as a percentage, cut: 100 says that it is all of them."""
    if math.isnan(share):
        return "–"
    return percent_cut(share, 2 if 0.99 <= share < 1.0 else 1).replace(".0 %", " %")


def element(tag: str, content: str, **attributes: str) -> str:
    """An element; ``content`` is HTML already, attribute values are not."""
    names = {name.rstrip("_").replace("_", "-"): value for name, value in attributes.items()}
    spelt = "".join(f' {name}="{esc(value)}"' for name, value in names.items())
    return f"<{tag}{spelt}>{content}</{tag}>"


def long_words(words: str) -> str:
    """Words of a cell that may break over lines; others stay on one."""
    return element("span", esc(words), class_="long")


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    css: str = "",
    row_css: Sequence[str] = (),
) -> str:
    """A table in a box that scrolls by itself; all cells are HTML already."""
    top = "".join(f'<th scope="col">{cell}</th>' for cell in head)
    body = []
    for i, row in enumerate(rows):
        cells = "".join(f"<td>{cell}</td>" for cell in row)
        mark = f' class="{esc(row_css[i])}"' if i < len(row_css) and row_css[i] else ""
        body.append(f"<tr{mark}>{cells}</tr>")
    inner = f"<table><thead><tr>{top}</tr></thead><tbody>{''.join(body)}</tbody></table>"
    return f'<div class="table {esc(css)}">{inner}</div>'


def text_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table whose cells are texts, escaped here."""
    return table([esc(cell) for cell in head], ([esc(cell) for cell in row] for row in rows))


def section(key: str, title: str, words: str, *content: str) -> str:
    """A section of the page: heading, explaining words (HTML), then the figures."""
    lead = f'<p class="lead">{words}</p>' if words else ""
    return f'<section id="{esc(key)}"><h2>{esc(title)}</h2>{lead}{"".join(content)}</section>'


def plot(key: str, caption: str, css: str = "", still: str = "") -> str:
    """The place of a plotly figure, which the page's script draws.

    ``still`` is the address of a picture of it, shown where the browser cannot draw scenes.
    """
    picture, held = "", ""
    if still:
        words = f"Still picture of the figure {key}: this browser has no WebGL to turn it."
        picture, held = f'<img class="still" alt="{esc(words)}" src="{esc(still)}">', " held"
    return (
        f'<figure class="plot {esc(css)}{held}"><figcaption>{caption}</figcaption>'
        f'{picture}<div class="canvas" id="{esc(key)}"></div></figure>'
    )
