"""Sheets as DXF, what is drawn in its true size: a CAD program measures millimetres."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rig.build.drawings.items import (
    ARROW_MM,
    DIMENSION_TEXT_MM,
    STYLES,
    CameraMark,
    Circle,
    Dimension,
    Item,
    Line,
    Sheet,
    Text,
    mark_parts,
)

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.layouts.layout import Modelspace

VERSION = "R2010"
BETWEEN_SHARE = 0.1
BLACK = "#000000"
"""Left to the CAD program, which shows it light on a dark screen."""

CAMERA_BLOCK = "CAMERA"
ANCHORS = {"start": "LEFT", "middle": "CENTER", "end": "RIGHT"}


@contextmanager
def _same_bytes() -> Iterator[None]:
    """Files without the time and without new identifiers, so that equal plans give equal files."""
    from ezdxf._options import options

    former = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        options.write_fixed_meta_data_for_testing = former


def dxf_bytes(sheets: Sequence[Sheet]) -> bytes:
    """The sheets side by side in model space, each as large as its scale says."""
    with _same_bytes():
        document = _document()
        space, left = document.modelspace(), 0.0
        for number, sheet in enumerate(sheets):
            pen = _Pen(document, space, sheet, left, number)
            for item in sheet.items:
                pen.draw(item)
            left += sheet.width_mm * sheet.denominator * (1.0 + BETWEEN_SHARE)
        # Left to itself the library lists its classes in the order of a set, another each run.
        for name in sorted(document.entitydb.dxf_types_in_use()):
            document.classes.add_class(name)
        stream = io.StringIO()
        document.write(stream)
    return stream.getvalue().encode("utf-8")


def _document() -> Drawing:
    from ezdxf import colors, units
    from ezdxf.filemanagement import new

    document = new(VERSION, setup=False)
    document.units = units.MM
    document.header["$MEASUREMENT"] = 1
    document.linetypes.add("RIG_CHAIN", [8.2, 5.0, -1.2, 0.8, -1.2], description="chain")
    for name, (width, colour, dashes) in STYLES.items():
        layer = document.layers.add(name.upper(), lineweight=_lineweight(width))
        if colour != BLACK:
            layer.rgb = colors.RGB.from_hex(colour)
        if dashes:
            layer.dxf.linetype = "RIG_CHAIN"
    block = document.blocks.new(CAMERA_BLOCK)
    for part in mark_parts(CameraMark("", 0.0, 0.0, ())):
        if isinstance(part, Circle):
            block.add_circle((part.x_mm, part.y_mm), part.radius_mm, {"layer": "AXIS"})
        elif isinstance(part, Line):
            block.add_lwpolyline(part.points_mm.tolist(), dxfattribs={"layer": "AXIS"})
    return document


def _lineweight(width_mm: float) -> int:
    """The nearest line weight that DXF knows, in hundredths of a millimetre."""
    known = (13, 18, 20, 25, 30, 35, 40, 50, 53, 60, 70)
    return min(known, key=lambda weight: abs(weight - 100.0 * width_mm))


class _Pen:
    """Draws the items of one sheet into model space."""

    def __init__(
        self, document: Drawing, space: Modelspace, sheet: Sheet, left: float, number: int
    ) -> None:
        self._space, self._left, self._scale = space, left, sheet.denominator
        self._style = f"RIG{number}"
        style = document.dimstyles.new(self._style)
        n = sheet.denominator
        style.dxf.dimtxt, style.dxf.dimasz = DIMENSION_TEXT_MM * n, ARROW_MM * n
        style.dxf.dimexo, style.dxf.dimexe, style.dxf.dimgap = 0.8 * n, 1.5 * n, 0.8 * n
        style.dxf.dimdec, style.dxf.dimtad, style.dxf.dimzin = 1, 1, 0

    def _place(self, x_mm: float, y_mm: float) -> tuple[float, float]:
        return self._left + float(x_mm) * self._scale, float(y_mm) * self._scale

    def draw(self, item: Item) -> None:
        """One item."""
        if isinstance(item, Line):
            points = [self._place(x, y) for x, y in item.points_mm]
            look = {"layer": item.style.upper(), "ltscale": self._scale}
            self._space.add_lwpolyline(points, close=item.closed, dxfattribs=look)
        elif isinstance(item, Circle):
            place = self._place(item.x_mm, item.y_mm)
            look = {"layer": item.style.upper()}
            self._space.add_circle(place, item.radius_mm * self._scale, look)
        elif isinstance(item, Text):
            self._text(item)
        elif isinstance(item, Dimension):
            self._dimension(item)
        else:
            self._camera(item)

    def _text(self, item: Text) -> None:
        from ezdxf.enums import TextEntityAlignment

        text = self._space.add_text(
            " ".join(item.words.split()) or " ",
            height=item.height_mm * self._scale,
            rotation=item.angle_deg,
            dxfattribs={"layer": item.style.upper()},
        )
        align = TextEntityAlignment[ANCHORS[item.anchor]]
        text.set_placement(self._place(item.x_mm, item.y_mm), align=align)

    def _dimension(self, item: Dimension) -> None:
        base = (item.place_mm, 0.0) if item.upright else (0.0, item.place_mm)
        self._space.add_linear_dim(
            base=self._place(*base),
            p1=self._place(*item.start_mm),
            p2=self._place(*item.end_mm),
            angle=90.0 if item.upright else 0.0,
            text=item.words,
            dimstyle=self._style,
            dxfattribs={"layer": "DIMENSION"},
        ).render()

    def _camera(self, item: CameraMark) -> None:
        place = self._place(item.x_mm, item.y_mm)
        size = {"layer": "AXIS", "xscale": self._scale, "yscale": self._scale}
        block = self._space.add_blockref(CAMERA_BLOCK, place, size)
        for tag, words in (("NAME", item.name), *item.figures):
            # Unseen: the label beside the mark is placed where there is room for it.
            look = {"height": self._scale, "flags": 1, "layer": "TEXT"}
            block.add_attrib(tag, words, place, look)
