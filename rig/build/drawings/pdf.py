"""Sheets as PDF."""

from __future__ import annotations

import io
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

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

if TYPE_CHECKING:
    from reportlab.pdfgen.canvas import Canvas

POINTS_PER_MM = 72.0 / 25.4
PLAIN, BOLD = "Vera", "VeraBd"
NOT_THERE = "?"


@lru_cache(maxsize=1)
def _faces() -> dict[str, Any]:
    """The typefaces, known to reportlab after this."""
    from reportlab.pdfbase import pdfmetrics
    from reportlab.pdfbase.ttfonts import TTFont

    for name in (PLAIN, BOLD):
        pdfmetrics.registerFont(TTFont(name, f"{name}.ttf"))
    fonts: dict[str, Any] = {name: pdfmetrics.getFont(name) for name in (PLAIN, BOLD)}
    return {name: font.face.charToGlyph for name, font in fonts.items()}


def printable(words: str, *, bold: bool = False) -> str:
    """``words`` with a question mark for every letter the typeface lacks."""
    known = _faces()[BOLD if bold else PLAIN]
    return "".join(c if ord(c) in known else NOT_THERE for c in words)


def text_width_mm(words: str, height_mm: float, *, bold: bool = False) -> float:
    """Width of a line of text whose capitals are ``height_mm`` high."""
    from reportlab.pdfbase.pdfmetrics import stringWidth

    face = BOLD if bold else PLAIN
    return float(stringWidth(printable(words, bold=bold), face, height_mm / CAPITAL_SHARE))


def pdf_bytes(sheets: Sequence[Sheet], title: str) -> bytes:
    """The sheets as pages in their true size; the same bytes every time."""
    from reportlab.pdfgen.canvas import Canvas

    stream = io.BytesIO()
    canvas = Canvas(stream, invariant=1, pageCompression=1)
    canvas.setTitle(title)
    canvas.setAuthor("Rigwright")
    for sheet in sheets:
        size = (sheet.width_mm * POINTS_PER_MM, sheet.height_mm * POINTS_PER_MM)
        canvas.setPageSize(size)
        canvas.bookmarkPage(sheet.title)
        canvas.addOutlineEntry(sheet.title, sheet.title, 0)
        canvas.scale(POINTS_PER_MM, POINTS_PER_MM)
        for item in sheet.items:
            _draw(canvas, item)
        canvas.showPage()
    canvas.save()
    return stream.getvalue()


def _draw(canvas: Canvas, item: Item) -> None:
    if isinstance(item, Dimension | CameraMark):
        parts = dimension_parts(item) if isinstance(item, Dimension) else mark_parts(item)
        for part in parts:
            _draw(canvas, part)
    elif isinstance(item, Text):
        _write(canvas, item)
    else:
        _stroke(canvas, item)


def _stroke(canvas: Canvas, item: Line | Circle) -> None:
    from reportlab.lib.colors import HexColor

    width, colour, dashes = STYLES[item.style]
    canvas.setStrokeColor(HexColor(colour))
    canvas.setLineWidth(width)
    canvas.setLineJoin(1)
    canvas.setLineCap(0)
    canvas.setDash(list(dashes), 0)
    if isinstance(item, Circle):
        canvas.circle(item.x_mm, item.y_mm, item.radius_mm)
        return
    path = canvas.beginPath()
    path.moveTo(*map(float, item.points_mm[0]))
    for point in item.points_mm[1:]:
        path.lineTo(*map(float, point))
    if item.closed:
        path.close()
    canvas.drawPath(path)


def _write(canvas: Canvas, item: Text) -> None:
    from reportlab.lib.colors import HexColor

    words = printable(item.words, bold=item.bold)
    canvas.setFillColor(HexColor(STYLES[item.style][1]))
    canvas.setFont(BOLD if item.bold else PLAIN, item.height_mm / CAPITAL_SHARE)
    canvas.saveState()
    canvas.translate(item.x_mm, item.y_mm)
    canvas.rotate(item.angle_deg)
    draw = {"start": canvas.drawString, "middle": canvas.drawCentredString}
    draw.get(item.anchor, canvas.drawRightString)(0.0, 0.0, words)
    canvas.restoreState()
