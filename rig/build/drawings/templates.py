"""Drilling templates in true size: on one sheet, or over pages that are joined."""

from __future__ import annotations

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, Ints
from rig.build.drawings.figures import mm
from rig.build.drawings.frame import A4_MM, MARGIN_MM, box
from rig.build.drawings.items import Circle, Item, Line, Sheet, Text
from rig.build.drawings.plates import PlateDrawing, hole_centre, plate_drawing, plate_shape
from rig.build.mounts.structure import Plate

PAPERS_MM = {"A4": A4_MM, "A3": (297.0, 420.0)}
OVERLAP_MM = 10.0
CHECK_MM = 100.0
FOOT_MM = 16.0
"""Room at the foot of a template page for its ruler and its name."""

CROSS_MM = 4.0


def template_sheet(plate: Plate) -> Sheet:
    """The plate in true size on one sheet of its own size: for a plotter, a laser, or CAD."""
    size = np.ptp(plate.outline_mm, axis=0)
    margin = np.array([15.0, 15.0 + FOOT_MM])
    drawing = plate_drawing(plate, margin, 1.0)
    items = [*plate_shape(drawing), *_hole_names(drawing), *_ruler(15.0, 8.0)]
    items.append(Text(_template_name(plate), 15.0 + CHECK_MM + 12.0, 8.0, 2.4))
    width = max(float(size[0]) + 30.0, CHECK_MM + 130.0)
    return Sheet(f"Template {plate.id}", width, float(size[1]) + 45.0, tuple(items))


def template_pages(plate: Plate, paper: str = "A4") -> tuple[Sheet, ...]:
    """The plate in true size over as many pages as it takes, to print at 100 % and to join.

    Neighbouring pages share a strip of 10 mm and the crosses in it. :class:`InputError` for a
    paper other than A4 and A3.
    """
    if paper not in PAPERS_MM:
        raise InputError("paper", f"no template is made on {paper!r}", "choose A4 or A3")
    size = np.ptp(plate.outline_mm, axis=0) + 2.0 * OVERLAP_MM
    upright = np.array(PAPERS_MM[paper])
    sheet, counts = min(
        ((turned, _page_counts(size, turned)) for turned in (upright, upright[::-1])),
        key=lambda choice: int(choice[1].prod()),
    )
    window = _window(sheet)
    return tuple(
        _page(plate, sheet, window, np.array([column, row]), counts)
        for row in reversed(range(int(counts[1])))
        for column in range(int(counts[0]))
    )


def _window(sheet: Floats) -> Floats:
    """Width and height of what a template page shows, (2,)."""
    return np.asarray(sheet - 2.0 * MARGIN_MM - np.array([0.0, FOOT_MM]))


def _page_counts(size: Floats, sheet: Floats) -> Ints:
    """Columns and rows of pages that show a size, (2,)."""
    steps = np.ceil((size - OVERLAP_MM) / (_window(sheet) - OVERLAP_MM) - 1e-9)
    return np.maximum(1, steps).astype(np.int64)


def _page(plate: Plate, sheet: Floats, window: Floats, index: Ints, counts: Ints) -> Sheet:
    """One page: the part of the plate that falls in its window."""
    corner = np.array([MARGIN_MM, MARGIN_MM + FOOT_MM])
    start = index * (window - OVERLAP_MM) - OVERLAP_MM
    drawing = plate_drawing(plate, corner - start, 1.0)
    inside = _clipped([*plate_shape(drawing), *_hole_names(drawing)], corner, corner + window)
    row, column = int(counts[1] - index[1]), int(index[0] + 1)
    name = f"{_template_name(plate)}, row {row} of {counts[1]}, column {column} of {counts[0]}"
    items = [*inside, _border(corner, corner + window), *_ruler(MARGIN_MM, MARGIN_MM)]
    items.append(Text(name, MARGIN_MM, MARGIN_MM + 8.5, 2.2, bold=True))
    where = f"window from X {mm(float(start[0]))}, Y {mm(float(start[1]))}"
    items.append(Text(where, float(sheet[0]) - MARGIN_MM, MARGIN_MM + 1.0, 2.0, "end"))
    items += _crosses(corner, window, index, counts)
    title = f"Template {plate.id} {row}/{column}"
    return Sheet(title, float(sheet[0]), float(sheet[1]), tuple(items))


def _template_name(plate: Plate) -> str:
    return f"Plate {plate.id}, template 1 : 1, print at 100 %"


def _hole_names(drawing: PlateDrawing) -> list[Item]:
    items: list[Item] = []
    for hole in drawing.plate.holes:
        x, y = drawing.paper(hole_centre(hole)[None])[0]
        size = hole.thread if hole.kind == "tapped" and hole.thread else f"Ø{hole.diameter_mm:g}"
        away = hole.diameter_mm / 2.0 + 1.0
        items.append(Text(f"{hole.label} {size}", float(x + away), float(y + 0.8), 1.9))
    return items


def _border(low: Floats, high: Floats) -> Item:
    return box(float(low[0]), float(low[1]), float(high[0]), float(high[1]), "thin")


def _ruler(x: float, y: float) -> list[Item]:
    """A ruler of 100 mm: measure it before drilling."""
    items: list[Item] = [Line(np.array([[x, y], [x + CHECK_MM, y]]), "mark")]
    for k in range(0, int(CHECK_MM) + 1, 10):
        tall = 4.0 if k % 50 == 0 else 2.5
        items.append(Line(np.array([[x + k, y], [x + k, y + tall]]), "mark"))
    words = "this ruler must measure 100 mm"
    return [*items, Text(words, x + 1.5, y + 5.0, 1.8)]


def _crosses(corner: Floats, window: Floats, index: Ints, counts: Ints) -> list[Item]:
    """Crosses in the middle of the strips that this page shares with its neighbours."""
    items: list[Item] = []
    half = OVERLAP_MM / 2.0
    xs = [corner[0] + window[0] * share for share in (0.25, 0.75)]
    ys = [corner[1] + window[1] * share for share in (0.25, 0.75)]
    places = []
    if index[0] > 0:
        places += [(corner[0] + half, y) for y in ys]
    if index[0] < counts[0] - 1:
        places += [(corner[0] + window[0] - half, y) for y in ys]
    if index[1] > 0:
        places += [(x, corner[1] + half) for x in xs]
    if index[1] < counts[1] - 1:
        places += [(x, corner[1] + window[1] - half) for x in xs]
    for x, y in places:
        items += [
            Line(np.array([[x - CROSS_MM, y], [x + CROSS_MM, y]]), "datum"),
            Line(np.array([[x, y - CROSS_MM], [x, y + CROSS_MM]]), "datum"),
            Circle(float(x), float(y), CROSS_MM / 2.0, "datum"),
        ]
    return items


def _clipped(items: list[Item], low: Floats, high: Floats) -> list[Item]:
    """What of lines, circles and texts lies in a window; circles count by their centre's reach."""
    out: list[Item] = []
    for item in items:
        if isinstance(item, Line):
            points = item.points_mm
            if item.closed:
                points = np.concatenate([points, points[:1]])
            parts = (_clip(points[k], points[k + 1], low, high) for k in range(len(points) - 1))
            out += [Line(part, item.style) for part in parts if part is not None]
        elif isinstance(item, Circle):
            reach, at = item.radius_mm, np.array([item.x_mm, item.y_mm])
            if ((at + reach > low) & (at - reach < high)).all():
                out.append(item)
        elif isinstance(item, Text):
            at = np.array([item.x_mm, item.y_mm])
            if ((at > low) & (at < high)).all():
                out.append(item)
    return out


def _clip(start: Floats, end: Floats, low: Floats, high: Floats) -> Floats | None:
    """The part of a segment inside a box (Liang and Barsky)."""
    step, first, last = end - start, 0.0, 1.0
    for axis in (0, 1):
        for slope, room in (
            (-step[axis], start[axis] - low[axis]),
            (step[axis], high[axis] - start[axis]),
        ):
            if abs(slope) < 1e-12:
                if room < 0.0:
                    return None
            elif slope < 0.0:
                first = max(first, room / slope)
            else:
                last = min(last, room / slope)
    return np.array([start + first * step, start + last * step]) if first < last else None
