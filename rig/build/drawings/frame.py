"""The frame of a sheet and its title block: what, of what, at what scale, seen how."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.build.drawings.figures import STATED
from rig.build.drawings.items import Circle, Item, Line, Sheet, Text
from rig.build.drawings.pdf import text_width_mm

MARGIN_MM = 10.0
BLOCK_MM = (184.0, 26.0)
A4_MM = (210.0, 297.0)
A3_LANDSCAPE_MM = (420.0, 297.0)
SMALLEST_TEXT_MM = 1.6
PROJECTION = "Third-angle"


@dataclass(frozen=True)
class Content:
    """What goes on a sheet before it is framed."""

    title: str
    size_mm: tuple[float, float]
    items: tuple[Item, ...]
    denominator: float = 1.0
    to_scale: bool = True
    projected: bool = False


def framed(plan_name: str, contents: Sequence[Content]) -> tuple[Sheet, ...]:
    """Sheets with frames and title blocks, numbered in their order."""
    return tuple(
        _framed(plan_name, content, f"{number} of {len(contents)}")
        for number, content in enumerate(contents, 1)
    )


def _framed(plan_name: str, content: Content, number: str) -> Sheet:
    width, height = content.size_mm
    border = box(MARGIN_MM, MARGIN_MM, width - MARGIN_MM, height - MARGIN_MM, "frame")
    items = (*content.items, border, *_block(plan_name, content, number))
    return Sheet(content.title, width, height, items, content.denominator)


def box(left: float, low: float, right: float, high: float, style: str) -> Line:
    """A rectangle."""
    return Line(np.array([[left, low], [right, low], [right, high], [left, high]]), style, True)


def fitted(text: Text, width_mm: float) -> Text:
    """The text no wider than that: smaller at first, then with its end left out."""
    wide = text_width_mm(text.words, text.height_mm, bold=text.bold)
    if wide <= width_mm:
        return text
    small = replace(text, height_mm=max(SMALLEST_TEXT_MM, text.height_mm * width_mm / wide))
    words = small.words
    while words and text_width_mm(words + "…", small.height_mm, bold=text.bold) > width_mm:
        words = words[:-1]
    whole = text_width_mm(small.words, small.height_mm, bold=text.bold) <= width_mm + 1e-9
    return small if whole else replace(small, words=words + "…")


def scale_words(denominator: float) -> str:
    """A scale as it is written."""
    return f"1 : {denominator:g}"


def _block(plan_name: str, content: Content, number: str) -> list[Item]:
    """The title block in the lower right corner."""
    right, low = content.size_mm[0] - MARGIN_MM, MARGIN_MM
    left, high = right - BLOCK_MM[0], low + BLOCK_MM[1]
    middle, symbol = low + 11.0, right - 34.0
    items: list[Item] = [
        box(left, low, right, high, "frame"),
        Line(np.array([[left, middle], [symbol, middle]]), "thin"),
        Line(np.array([[symbol, low], [symbol, high]]), "thin"),
    ]
    words = symbol - left - 6.0
    items += [
        fitted(Text(plan_name, left + 3.0, high - 6.5, 3.5, bold=True), words),
        fitted(Text(content.title, left + 3.0, middle + 2.2, 2.8), words),
    ]
    scale = scale_words(content.denominator) if content.to_scale else "not to scale"
    cells = (("Scale", scale, 24.0), ("Sheet", number, 22.0), ("Units", "mm, degrees", 29.0))
    at = left
    for heading, value, width in (*cells, ("Stated", STATED, symbol - left - 75.0)):
        items += [
            Text(heading, at + 3.0, middle - 3.6, 1.6, style="thin"),
            fitted(Text(value, at + 3.0, low + 2.4, 2.4), width - 4.0),
            Line(np.array([[at + width, low], [at + width, middle]]), "thin"),
        ]
        at += width
    if content.projected:
        items += _symbol(symbol + 17.0, (low + high) / 2.0 + 2.0)
        name = Text(PROJECTION, symbol + 17.0, low + 2.4, 1.8, "middle")
    else:
        name = Text("Rigwright", symbol + 17.0, (low + high) / 2.0 - 1.2, 2.4, "middle")
    return [*items, name]


def _symbol(x: float, y: float) -> list[Item]:
    """The third-angle symbol: both circles of a cone, and right of them the cone from its side."""
    cone = np.array([[3.0, -2.2], [11.0, -4.4], [11.0, 4.4], [3.0, 2.2]]) + np.array([x, y])
    return [
        Circle(x - 6.0, y, 2.2, "visible"),
        Circle(x - 6.0, y, 4.4, "visible"),
        Line(np.array([[x - 11.5, y], [x - 0.5, y]]), "axis"),
        Line(np.array([[x - 6.0, y - 5.5], [x - 6.0, y + 5.5]]), "axis"),
        Line(cone, "visible", True),
        Line(np.array([[x + 1.5, y], [x + 12.5, y]]), "axis"),
    ]
