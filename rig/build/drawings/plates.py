"""Plates: a dimensioned drawing, and a drilling template in true size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from rig.build.drawings.annotate import Ordinate, merged, ordinate_items
from rig.build.drawings.figures import mm
from rig.build.drawings.frame import A3_LANDSCAPE_MM, BLOCK_MM, MARGIN_MM, Content, framed
from rig.build.drawings.items import Circle, Dimension, Item, Line, Sheet, Text
from rig.build.drawings.layout import DENOMINATORS
from rig.build.drawings.tables import Table, table_items, table_sheets
from rig.build.mounts.structure import Hole, Plate

EDGE_MM = 26.0
HOLE_COLUMNS = ("No.", "Hole", "X mm", "Y mm", "Ø mm", "Kind", "Thread")
TABLE_SHARE_MM = 130.0


@dataclass(frozen=True, eq=False)
class PlateDrawing:
    """A plate on the paper; ``corner_mm`` is the lower left corner of its box, the plate's zero."""

    plate: Plate
    corner_mm: Floats
    origin_mm: Floats
    denominator: float

    def paper(self, points_mm: Floats) -> Floats:
        """Points (N, 2) of the plate on the paper."""
        return np.asarray((points_mm - self.corner_mm) / self.denominator + self.origin_mm)


def plate_drawing(plate: Plate, origin_mm: Floats, denominator: float) -> PlateDrawing:
    """The plate with the lower left corner of its box at ``origin_mm`` (2,) of the paper."""
    return PlateDrawing(plate, plate.outline_mm.min(axis=0), origin_mm, denominator)


def plate_sheets(plan_name: str, plate: Plate) -> tuple[Sheet, ...]:
    """A plate seen from the side that the cameras' mounts sit on, with all its holes.

    Coordinates count from the lower left corner of the plate's box.
    """
    size = np.ptp(plate.outline_mm, axis=0)
    holes = Table("Holes, from the lower left corner", HOLE_COLUMNS, hole_rows(plate))
    top = A3_LANDSCAPE_MM[1] - MARGIN_MM - 6.0
    beside = holes.height_mm() <= top - (MARGIN_MM + BLOCK_MM[1] + 6.0)
    n = _denominator(size, TABLE_SHARE_MM if beside else 0.0)
    base = np.array([MARGIN_MM + EDGE_MM, MARGIN_MM + BLOCK_MM[1] + EDGE_MM])
    drawing = plate_drawing(plate, base, n)
    items = [*plate_shape(drawing), *_numbers(drawing), *_dimensioned(drawing)]
    words = f"{plate.material}, {plate.thickness_mm:g} mm thick; seen from the cameras' side"
    items.append(Text(words, MARGIN_MM + 5.0, top - 3.0, 2.6, bold=True))
    left = A3_LANDSCAPE_MM[0] - MARGIN_MM - TABLE_SHARE_MM
    more: list[Content] = []
    if beside:
        items += table_items(holes, left, top, TABLE_SHARE_MM - 5.0)
    else:
        more = table_sheets([holes], f"Plate {plate.id}: holes", A3_LANDSCAPE_MM)
    first = Content(f"Plate {plate.id}", A3_LANDSCAPE_MM, tuple(items), n)
    return framed(plan_name, [first, *more])


def hole_rows(plate: Plate) -> tuple[tuple[str, ...], ...]:
    """A row of :data:`HOLE_COLUMNS` per hole."""
    corner = plate.outline_mm.min(axis=0)
    return tuple(
        (
            str(number),
            hole.label,
            mm(hole.x_mm - float(corner[0])),
            mm(hole.y_mm - float(corner[1])),
            mm(hole.diameter_mm),
            hole.kind,
            hole.thread or "–",
        )
        for number, hole in enumerate(plate.holes, 1)
    )


def _denominator(size: Floats, table_mm: float) -> float:
    across = A3_LANDSCAPE_MM[0] - 2.0 * MARGIN_MM - 2.0 * EDGE_MM - table_mm
    upwards = A3_LANDSCAPE_MM[1] - 2.0 * MARGIN_MM - BLOCK_MM[1] - 2.0 * EDGE_MM
    for n in DENOMINATORS:
        if size[0] / n <= across and size[1] / n <= upwards:
            return float(n)
    raise InputError("drawing-size", "the plate is too large for a drawing", "divide the plate")


def plate_shape(drawing: PlateDrawing) -> list[Item]:
    """Outline, cut-outs and holes with their centres."""
    plate, n = drawing.plate, drawing.denominator
    items: list[Item] = [Line(drawing.paper(plate.outline_mm), "outline", True)]
    items += [Line(drawing.paper(cut), "outline", True) for cut in plate.cutouts_mm]
    for hole in plate.holes:
        items += _hole(drawing.paper(hole_centre(hole)[None])[0], hole.diameter_mm / 2.0 / n)
    return items


def hole_centre(hole: Hole) -> Floats:
    """Centre of a hole in the plate's plane, (2,)."""
    return np.array([hole.x_mm, hole.y_mm])


def _hole(at: Floats, radius: float) -> list[Item]:
    x, y, arm = float(at[0]), float(at[1]), radius + 1.5
    return [
        Circle(x, y, radius, "visible"),
        Line(np.array([[x - arm, y], [x + arm, y]]), "thin"),
        Line(np.array([[x, y - arm], [x, y + arm]]), "thin"),
    ]


def _numbers(drawing: PlateDrawing) -> list[Item]:
    items: list[Item] = []
    for number, hole in enumerate(drawing.plate.holes, 1):
        x, y = drawing.paper(hole_centre(hole)[None])[0]
        away = hole.diameter_mm / 2.0 / drawing.denominator * 0.7 + 0.8
        items.append(Text(str(number), float(x + away), float(y + away), 1.9))
    return items


def _dimensioned(drawing: PlateDrawing) -> list[Item]:
    """Width, height, and an ordinate for every line of holes."""
    (left, low) = drawing.origin_mm
    (wide, tall) = np.ptp(drawing.plate.outline_mm, axis=0) / drawing.denominator
    size = np.ptp(drawing.plate.outline_mm, axis=0)
    items: list[Item] = [
        Dimension(
            (left, low + tall), (left + wide, low + tall), low + tall + 8.0, False, mm(size[0])
        ),
        Dimension(
            (left + wide, low), (left + wide, low + tall), left + wide + 9.0, True, mm(size[1])
        ),
    ]
    centres = np.array([hole_centre(hole) for hole in drawing.plate.holes]).reshape(-1, 2)
    figures = centres - drawing.corner_mm
    places = drawing.paper(centres)
    for axis, start, room in ((0, low, wide), (1, left, tall)):
        lines = [
            Ordinate(float(p), mm(float(f)))
            for p, f in zip(places[:, axis], figures[:, axis], strict=True)
        ]
        if len(merged(lines)) * 3.0 <= room + 20.0:
            items += ordinate_items(lines, float(start), -10.0, upright=axis == 1)
    return items
