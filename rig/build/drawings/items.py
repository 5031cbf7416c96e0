"""What a drawing is made of, before it becomes DXF, SVG or PDF.

Paper coordinates: millimetres, x to the right, y up, from the lower left corner of the sheet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats, frozen

CAPITAL_SHARE = 0.729
"""Height of a capital over the font size, of the typeface in the PDF and in the SVG."""

STYLES: dict[str, tuple[float, str, tuple[float, ...]]] = {
    "frame": (0.5, "#000000", ()),
    "visible": (0.30, "#000000", ()),
    "outline": (0.50, "#000000", ()),
    "camera": (0.40, "#1f4e9e", ()),
    "head": (0.18, "#7a5a48", (4.0, 1.5, 0.5, 1.5, 0.5, 1.5)),
    "thin": (0.13, "#555555", ()),
    "axis": (0.18, "#b3261e", (5.0, 1.2, 0.8, 1.2)),
    "dimension": (0.13, "#000000", ()),
    "datum": (0.35, "#b3261e", ()),
    "mark": (0.18, "#000000", ()),
    "text": (0.18, "#000000", ()),
}
"""By name: width of the line in mm, colour, dashes in mm. The name is the layer in DXF."""

ARROW_MM = 2.5
DIMENSION_TEXT_MM = 2.5
GAP_MM = 0.8


@dataclass(frozen=True, eq=False)
class Line:
    """An open or closed run of straight lines through ``points_mm`` (N, 2)."""

    points_mm: Floats
    style: str = "visible"
    closed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "points_mm", frozen(self.points_mm))


@dataclass(frozen=True)
class Circle:
    """A circle."""

    x_mm: float
    y_mm: float
    radius_mm: float
    style: str = "visible"


@dataclass(frozen=True)
class Text:
    """A line of text; ``height_mm`` of its capitals, ``at`` its baseline's start, middle or end."""

    words: str
    x_mm: float
    y_mm: float
    height_mm: float = 2.5
    anchor: str = "start"
    angle_deg: float = 0.0
    style: str = "text"
    bold: bool = False


@dataclass(frozen=True)
class Dimension:
    """The distance of two points along the sheet (``upright`` False) or up it.

    ``place_mm`` is where the dimension line runs: its y, or its x when ``upright``.
    """

    start_mm: tuple[float, float]
    end_mm: tuple[float, float]
    place_mm: float
    upright: bool
    words: str


@dataclass(frozen=True)
class CameraMark:
    """The optical centre of a camera in a view; in DXF a block with its pose as attributes."""

    name: str
    x_mm: float
    y_mm: float
    figures: tuple[tuple[str, str], ...]


Item = Line | Circle | Text | Dimension | CameraMark


@dataclass(frozen=True)
class Sheet:
    """One sheet. ``denominator`` is the N of its scale 1 : N; what is drawn in DXF is 1 : 1."""

    title: str
    width_mm: float
    height_mm: float
    items: tuple[Item, ...]
    denominator: float = 1.0


def dimension_parts(dimension: Dimension) -> list[Item]:
    """A dimension as lines and text, where a format has none of its own."""
    ends = np.array([dimension.start_mm, dimension.end_mm])
    if dimension.upright:
        ends = ends[:, ::-1]
    low, high = ends[ends[:, 0].argsort()]
    place = dimension.place_mm
    beyond = np.sign(place - (low[1] + high[1]) / 2.0) or 1.0
    runs = [
        [[point[0], point[1] + beyond * GAP_MM], [point[0], place + beyond * 1.5]]
        for point in (low, high)
    ]
    runs.append([[low[0], place], [high[0], place]])
    room = high[0] - low[0] > 3.0 * ARROW_MM
    for tip, inwards in ((low[0], 1.0), (high[0], -1.0)):
        back = tip + inwards * ARROW_MM * (1.0 if room else -1.0)
        runs.append([[back, place + 0.4], [tip, place], [back, place - 0.4]])
    lines = [np.array(run) for run in runs]
    if dimension.upright:
        lines = [line[:, ::-1] for line in lines]
    middle = (low[0] + high[0]) / 2.0
    parts: list[Item] = [Line(line, "dimension") for line in lines]
    x, y = (place - GAP_MM, middle) if dimension.upright else (middle, place + GAP_MM)
    angle = 90.0 if dimension.upright else 0.0
    text = Text(dimension.words, x, y, DIMENSION_TEXT_MM, "middle", angle, "dimension")
    return [*parts, text]


def mark_parts(mark: CameraMark) -> list[Item]:
    """A camera's mark as a small cross in a circle."""
    x, y, arm = mark.x_mm, mark.y_mm, 1.5
    return [
        Line(np.array([[x - arm, y], [x + arm, y]]), "axis"),
        Line(np.array([[x, y - arm], [x, y + arm]]), "axis"),
        Circle(x, y, 0.8, "axis"),
    ]
