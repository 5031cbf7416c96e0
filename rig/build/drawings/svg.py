"""Sheets as SVG: one document, its size in millimetres, text as text."""

from __future__ import annotations

from collections.abc import Sequence
from xml.sax.saxutils import escape, quoteattr

from rig.build.drawings.items import (
    CAPITAL_SHARE,
    STYLES,
    CameraMark,
    Circle,
    Dimension,
    Item,
    Line,
    Sheet,
    Text,
    dimension_parts,
    mark_parts,
)

BETWEEN_MM = 10.0
FAMILY = "'Bitstream Vera Sans','DejaVu Sans',Verdana,sans-serif"
NOT_IN_XML = dict.fromkeys((*range(9), 11, 12, *range(14, 32)), "?")


def svg_bytes(sheets: Sequence[Sheet], title: str) -> bytes:
    """The sheets below each other, in their true size; the same bytes every time."""
    width = max(sheet.width_mm for sheet in sheets)
    height = sum(sheet.height_mm for sheet in sheets) + BETWEEN_MM * (len(sheets) - 1)
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_n(width)}mm" height="{_n(height)}mm" '
        f'viewBox="0 0 {_n(width)} {_n(height)}">',
        f"<title>{_words(title)}</title>",
        f"<style>{_style()}</style>",
    ]
    top = 0.0
    for sheet in sheets:
        # The group turns the paper's y up; texts turn themselves back.
        base = top + sheet.height_mm
        size = f'width="{_n(sheet.width_mm)}" height="{_n(sheet.height_mm)}"'
        parts.append(
            f'<g transform="matrix(1 0 0 -1 0 {_n(base)})" aria-label={_quoted(sheet.title)}>'
            f'<rect class="paper" {size}/>'
        )
        parts += [_drawn(item) for item in sheet.items]
        parts.append("</g>")
        top += sheet.height_mm + BETWEEN_MM
    return "\n".join([*parts, "</svg>\n"]).encode()


def _style() -> str:
    rules = [".paper{fill:#fff}", f"text{{font-family:{FAMILY}}}", ".b{font-weight:bold}"]
    for name, (width, colour, dashes) in STYLES.items():
        dash = f";stroke-dasharray:{' '.join(map(_n, dashes))}" if dashes else ""
        rules.append(
            f".{name}{{fill:none;stroke:{colour};stroke-width:{_n(width)}{dash}}}"
            f"text.{name}{{fill:{colour};stroke:none}}"
        )
    return "".join(rules)


def _n(value: float) -> str:
    """A number to a thousandth of a millimetre, as short as it goes."""
    return f"{value:.3f}".rstrip("0").rstrip(".") or "0"


def _words(text: str) -> str:
    return escape(text.translate(NOT_IN_XML))


def _quoted(text: str) -> str:
    return quoteattr(text.translate(NOT_IN_XML))


def _drawn(item: Item) -> str:
    if isinstance(item, Dimension):
        return "".join(map(_drawn, dimension_parts(item)))
    if isinstance(item, CameraMark):
        inner = "".join(map(_drawn, mark_parts(item)))
        return f"<g data-camera={_quoted(item.name)}>{inner}</g>"
    if isinstance(item, Circle):
        place = f'cx="{_n(item.x_mm)}" cy="{_n(item.y_mm)}" r="{_n(item.radius_mm)}"'
        return f'<circle class="{item.style}" {place}/>'
    if isinstance(item, Line):
        points = " ".join(f"{_n(x)},{_n(y)}" for x, y in item.points_mm)
        shape = "polygon" if item.closed else "polyline"
        return f'<{shape} class="{item.style}" points="{points}"/>'
    return _text(item)


def _text(item: Text) -> str:
    turn = f" rotate({_n(-item.angle_deg)})" if item.angle_deg else ""
    place = f'transform="translate({_n(item.x_mm)} {_n(item.y_mm)}) scale(1 -1){turn}"'
    size = _n(item.height_mm / CAPITAL_SHARE)
    css = f"{item.style} b" if item.bold else item.style
    anchor = "" if item.anchor == "start" else f' text-anchor="{item.anchor}"'
    return f'<text class="{css}" font-size="{size}"{anchor} {place}>{_words(item.words)}</text>'
