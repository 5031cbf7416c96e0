"""Targets on paper at true scale, as PDF and SVG, with a ruler to check the printer by."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

import numpy as np

from calibration.targets.boardpatterns import board_pattern
from calibration.targets.boards import Board
from calibration.targets.drawing import (
    Area,
    Drawing,
    Label,
    board_areas,
    marker_areas,
    plate_areas,
    rectangle,
    ring_areas,
)
from calibration.targets.kinds import (
    RING_QUIET,
    CarrierKind,
    CharucoPlate,
    MarkerCarrier,
    RingCarrier,
)
from common.errors import InputError
from geometry.arrays import Floats

if TYPE_CHECKING:
    from reportlab.pdfgen.canvas import Canvas

PAGES_MM = {"A4": (210.0, 297.0), "A3": (297.0, 420.0), "LETTER": (215.9, 279.4)}
MARGIN_MM = 8.0
_RULER_MM, _FOOT_MM, _TEXT_MM = 100.0, 22.0, 3.0
_POINTS_PER_MM = 72.0 / 25.4

Separate = MarkerCarrier | RingCarrier
"""Carriers whose targets are separate pictures, each with a number."""


def page_size(page: str) -> tuple[float, float]:
    """Width and height in millimetres of ``A4``, ``A3``, ``letter`` or ``600x400``, and turned."""
    name, _, turned = page.strip().partition(" ")
    size = PAGES_MM.get(name.upper())
    if size is None:
        parts = name.lower().split("x")
        try:
            size = float(parts[0]), float(parts[1])
        except (ValueError, IndexError):
            size = (float("nan"),) * 2
    good = len(name.split("x")) <= 2 and min(size) >= 50.0 and max(size) <= 5000.0
    if not good or turned not in ("", "landscape"):
        raise InputError(
            "page",
            f"there is no page {page!r}",
            "give A4, A3, letter, 'A4 landscape', or width x height in millimetres such as 600x400",
        )
    return (size[1], size[0]) if turned else size


def carrier_drawings(kind: CarrierKind, page: str = "A4", todo: str = "") -> tuple[Drawing, ...]:
    """The pages of a carrier, drawn at its nominal size; ``todo`` stands at their foot.

    A carrier whose places are known is drawn as it is, on one page. Targets without places are
    laid out in rows on as many pages as they need. Raises :class:`InputError` when it does not
    fit.
    """
    width, height = page_size(page)
    if isinstance(kind, Board):
        left, top, right, bottom = board_pattern(kind).extent_mm
        offset = _centred(
            kind.name, np.array([left, top]), np.array([right, bottom]), width, height
        )
        return (_page(kind, width, height, list(board_areas(kind, offset)), []),)
    if isinstance(kind, CharucoPlate):
        border = kind.square_mm / 4.0
        low = np.full(2, -border)
        offset = _centred(kind.name, low, np.array(kind.size_mm) + border, width, height)
        return (_page(kind, width, height, list(plate_areas(kind, offset)), []),)
    places = np.array([p.position_mm for p in kind.places])
    reach = _reach(kind)
    if np.isfinite(places).all():
        if np.ptp(places[:, 2]) > 1e-6:
            raise InputError(
                "print-flat",
                f"carrier {kind.name!r} is not flat, so it is no sheet",
                "print its targets as a sheet of numbers, without places",
            )
        low, high = places[:, :2].min(axis=0) - reach, places[:, :2].max(axis=0) + reach
        spots = places[:, :2] + _centred(kind.name, low, high, width, height)
        numbers = [p.number for p in kind.places]
        return (_targets_page(kind, numbers, spots, width, height),)
    pages = _rows(kind, reach, width, height)
    at = MARGIN_MM, height - MARGIN_MM - _FOOT_MM + 3.0, _TEXT_MM
    return tuple(replace(p, labels=(*p.labels, Label(*at, todo))) for p in pages) if todo else pages


def to_pdf(drawings: Sequence[Drawing], title: str) -> bytes:
    """Pages as PDF. Viewers are told not to scale when printing."""
    from reportlab.pdfgen.canvas import Canvas

    buffer = io.BytesIO()
    canvas = Canvas(buffer, invariant=1, pageCompression=1)
    canvas.setTitle(title)
    canvas.setViewerPreference("PrintScaling", "None")
    for drawing in drawings:
        _draw(canvas, drawing)
        canvas.showPage()
    canvas.save()
    return buffer.getvalue()


def _draw(canvas: Canvas, drawing: Drawing) -> None:
    """One page, in millimetres with y down like the drawing."""
    canvas.setPageSize((drawing.width_mm * _POINTS_PER_MM, drawing.height_mm * _POINTS_PER_MM))
    canvas.translate(0, drawing.height_mm * _POINTS_PER_MM)
    canvas.scale(_POINTS_PER_MM, -_POINTS_PER_MM)
    for area in drawing.areas:
        path = canvas.beginPath()
        for polygon in area.polygons:
            path.moveTo(*map(float, polygon[0]))
            for point in polygon[1:]:
                path.lineTo(*map(float, point))
            path.close()
        canvas.setFillGray(0.0 if area.black else 1.0)
        canvas.drawPath(path, stroke=0, fill=1, fillMode=1)
    canvas.setFillGray(0.0)
    for label in drawing.labels:
        canvas.saveState()
        canvas.translate(label.x_mm, label.y_mm)
        canvas.scale(1.0, -1.0)
        canvas.setFont("Helvetica", label.height_mm)
        canvas.drawString(0.0, 0.0, label.text)
        canvas.restoreState()


def to_svg(drawing: Drawing) -> str:
    """One page as SVG, one user unit a millimetre."""
    width, height = drawing.width_mm, drawing.height_mm
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
        f'viewBox="0 0 {width:g} {height:g}">',
        f'<rect width="{width:g}" height="{height:g}" fill="#fff"/>',
    ]
    for area in drawing.areas:
        path = "".join(
            "M" + "L".join(f"{x:.5f},{y:.5f}" for x, y in polygon) + "Z"
            for polygon in area.polygons
        )
        parts.append(f'<path fill="{"#000" if area.black else "#fff"}" d="{path}"/>')
    parts += [
        f'<text x="{label.x_mm:.3f}" y="{label.y_mm:.3f}" font-family="sans-serif" '
        f'font-size="{label.height_mm:g}">{escape(label.text)}</text>'
        for label in drawing.labels
    ]
    return "\n".join([*parts, "</svg>", ""])


def _reach(kind: Separate) -> float:
    """Half the paper that one target needs."""
    if isinstance(kind, MarkerCarrier):
        return kind.size_mm * 0.6
    return RING_QUIET * kind.dot_radius_mm


def _centred(name: str, low: Floats, high: Floats, width: float, height: float) -> Floats:
    """What to add so that a box is in the middle of the page above its foot."""
    room = np.array([width - 2.0 * MARGIN_MM, height - 2.0 * MARGIN_MM - _FOOT_MM])
    size = high - low
    if (size > room + 1e-6).any():
        raise InputError(
            "print-page",
            f"carrier {name!r} takes {size[0]:.0f} x {size[1]:.0f} mm, the page has room for "
            f"{room[0]:.0f} x {room[1]:.0f}",
            "take a larger page, turn it (landscape), or make the carrier smaller",
        )
    return np.asarray(MARGIN_MM + (room - size) / 2.0 - low)


def _rows(kind: Separate, reach: float, width: float, height: float) -> tuple[Drawing, ...]:
    """Targets without places, in rows with a label each."""
    cell = 2.0 * reach + 2.0 * _TEXT_MM
    columns = int((width - 2.0 * MARGIN_MM) // cell)
    rows = int((height - 2.0 * MARGIN_MM - _FOOT_MM) // cell)
    if min(columns, rows) < 1:
        _centred(kind.name, np.zeros(2), np.full(2, cell), width, height)
    pages = []
    numbers = [p.number for p in kind.places]
    for first in range(0, len(numbers), columns * rows):
        mine = numbers[first : first + columns * rows]
        spots = np.array([[k % columns, k // columns] for k in range(len(mine))]) * cell
        spots = spots + MARGIN_MM + cell / 2.0
        pages.append(_targets_page(kind, mine, spots, width, height))
    return tuple(pages)


def _targets_page(
    kind: Separate, numbers: Sequence[int], spots: Floats, width: float, height: float
) -> Drawing:
    areas: list[Area] = []
    labels: list[Label] = []
    reach = _reach(kind)
    for number, spot in zip(numbers, spots, strict=True):
        if isinstance(kind, MarkerCarrier):
            areas += marker_areas(kind, number, spot)
        else:
            areas += ring_areas(kind, number, spot)
        at = float(spot[0]) - reach, float(spot[1]) + reach + 0.8 * _TEXT_MM
        labels.append(Label(*at, 0.7 * _TEXT_MM, kind.id_of(number)))
    return _page(kind, width, height, areas, labels)


def _page(
    kind: CarrierKind, width: float, height: float, areas: list[Area], labels: list[Label]
) -> Drawing:
    """A page with its foot: a ruler, what it is, and what to do with it."""
    base = height - MARGIN_MM - 10.0
    length = _RULER_MM if width >= _RULER_MM + 2.0 * MARGIN_MM else 20.0
    marks = [rectangle(MARGIN_MM, base, MARGIN_MM + length, base + 0.3)]
    for k in range(int(length / 10.0) + 1):
        # A tick's left edge is the measure, so that the ruler is as long as it says.
        x, tall = MARGIN_MM + 10.0 * k, 5.0 if k % 5 == 0 else 3.0
        marks.append(rectangle(x, base - tall, x + 0.2, base))
    texts = (
        f"{kind.name}: print at 100 % on flat board. From the left edge of the first tick to that",
        f"of the last this ruler is {length:g} mm; write what you measure into the target file.",
    )
    foot = [Label(MARGIN_MM, base + 4.5 + 4.0 * k, _TEXT_MM, text) for k, text in enumerate(texts)]
    return Drawing(width, height, (*areas, Area(tuple(marks))), (*labels, *foot))
