"""How white a target is at a place of its plane: the one truth that is printed and rendered.

A pattern answers for small soft boxes instead of points: the share of white in a box of the
plane. Edges then have no stairs, however coarsely the plane is sampled. Sampled at a pitch of
one box, the picture is blurred by ``SOFTNESS`` of it (rms), which whoever samples takes off.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from calibration.detection import opencv
from calibration.targets.kinds import (
    DOT_CLEAR_MODULES,
    DOT_RADIUS_MODULES,
    RING_INNER,
    RING_OUTER,
    RING_QUIET,
    CharucoPlate,
    MarkerCarrier,
    RingCarrier,
)
from geometry.arrays import Bools, Floats, Ints

SOFTNESS = float(np.sqrt(1.0 / 6.0))


class Pattern(Protocol):
    """Something flat with black and white on it; x to the right, y down, millimetres."""

    @property
    def extent_mm(self) -> tuple[float, float, float, float]:
        """Left, top, right, bottom of the paper it stands on."""
        ...

    @property
    def outline_mm(self) -> Floats:
        """Points (n, 2) whose hull is what belongs to the target."""
        ...

    @property
    def finest_mm(self) -> float:
        """Size of the smallest part: boxes must be smaller."""
        ...

    def white_share(self, x_mm: Floats, y_mm: Floats, box_mm: tuple[float, float]) -> Floats:
        """Share of white (0 to 1) in boxes about the places, all arrays of one shape."""
        ...

    def within_mm(self, x_mm: Floats, y_mm: Floats) -> Floats:
        """How far inside what belongs to the target places are, negative outside."""
        ...


@dataclass(frozen=True, eq=False)
class ModulePattern:
    """Square modules, black or white: a plate or a marker, with white paper round it.

    ``white`` (rows, columns) of modules of ``module_mm``, the first one's outer corner at
    ``origin_mm``; ``dot`` puts a dot of the given radii (black, then clear) in the middle.
    """

    white: Bools
    module_mm: float
    origin_mm: tuple[float, float]
    border_mm: float
    dot: bool = False
    inverted: bool = False

    @property
    def extent_mm(self) -> tuple[float, float, float, float]:
        """Left, top, right, bottom with the border."""
        rows, columns = self.white.shape
        left, top = self.origin_mm
        return (
            left - self.border_mm,
            top - self.border_mm,
            left + columns * self.module_mm + self.border_mm,
            top + rows * self.module_mm + self.border_mm,
        )

    @property
    def outline_mm(self) -> Floats:
        """Corners of the border."""
        return corners_of(self.extent_mm)

    @property
    def finest_mm(self) -> float:
        """Side of a module, or the dot's radius."""
        return self.module_mm * (DOT_RADIUS_MODULES if self.dot else 1.0)

    def within_mm(self, x_mm: Floats, y_mm: Floats) -> Floats:
        """Distance to the nearest edge of the border."""
        return within_box(self.extent_mm, x_mm, y_mm)

    @property
    def middle_mm(self) -> tuple[float, float]:
        """Middle of the pattern."""
        rows, columns = self.white.shape
        left, top = self.origin_mm
        return left + columns * self.module_mm / 2.0, top + rows * self.module_mm / 2.0

    def white_share(self, x_mm: Floats, y_mm: Floats, box_mm: tuple[float, float]) -> Floats:
        """Share of white in boxes about the places."""
        padded = np.pad(self.white, 1, constant_values=True).astype(np.float64)
        columns = split_cells(
            (x_mm - self.origin_mm[0]) / self.module_mm, box_mm[0] / self.module_mm
        )
        rows = split_cells((y_mm - self.origin_mm[1]) / self.module_mm, box_mm[1] / self.module_mm)
        share = np.zeros(np.shape(x_mm))
        for row, row_part in rows:
            row = np.clip(row + 1, 0, padded.shape[0] - 1)
            for column, part in columns:
                column = np.clip(column + 1, 0, padded.shape[1] - 1)
                share += padded[row, column] * row_part * part
        if self.dot:
            middle = self.middle_mm
            away, box = _polar(x_mm - middle[0], y_mm - middle[1], box_mm)
            clear = inside_share(DOT_CLEAR_MODULES * self.module_mm - away, box)
            share += clear * (1.0 - share)
            share *= 1.0 - inside_share(DOT_RADIUS_MODULES * self.module_mm - away, box)
        return 1.0 - share if self.inverted else share


@dataclass(frozen=True, eq=False)
class RingPattern:
    """A ring-coded target about the origin; bit k of ``word`` is black from k to k + 1 sectors.

    Sector 0 begins on the x axis, and sectors follow each other clockwise as seen.
    """

    word: int
    bits: int
    dot_radius_mm: float
    inverted: bool = False

    @property
    def extent_mm(self) -> tuple[float, float, float, float]:
        """Left, top, right, bottom with the clear space."""
        reach = RING_QUIET * self.dot_radius_mm
        return -reach, -reach, reach, reach

    @property
    def outline_mm(self) -> Floats:
        """Points on the edge of the clear space."""
        angle = np.arange(16) * np.pi / 8.0
        circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.asarray(RING_QUIET * self.dot_radius_mm * circle)

    def within_mm(self, x_mm: Floats, y_mm: Floats) -> Floats:
        """Distance to the edge of the clear space, which is round: paper may be cut anyhow."""
        return np.asarray(RING_QUIET * self.dot_radius_mm - np.hypot(x_mm, y_mm))

    @property
    def finest_mm(self) -> float:
        """Half the dot's radius: two thirds of a sector at the ring's inner edge."""
        return self.dot_radius_mm / 2.0

    def white_share(self, x_mm: Floats, y_mm: Floats, box_mm: tuple[float, float]) -> Floats:
        """Share of white in boxes about the places."""
        away, box = _polar(x_mm, y_mm, box_mm)
        radius = self.dot_radius_mm
        black = inside_share(radius - away, box)
        band = inside_share(RING_OUTER * radius - away, box) - inside_share(
            RING_INNER * radius - away, box
        )
        turn = (np.arctan2(y_mm, x_mm) / (2.0 * np.pi) * self.bits) % self.bits
        sector_mm = 2.0 * np.pi / self.bits * np.maximum(away, radius)
        code = np.zeros(np.shape(x_mm))
        table = np.array([(self.word >> k) & 1 for k in range(self.bits)], dtype=np.float64)
        for sector, part in split_cells(turn, np.minimum(box / sector_mm, 0.5)):
            code += table[sector % self.bits] * part
        black += band * code
        return black if self.inverted else 1.0 - black


def _polar(x_mm: Floats, y_mm: Floats, box_mm: tuple[float, float]) -> tuple[Floats, Floats]:
    """Distance from the origin, and the box's size along that direction."""
    away = np.maximum(np.hypot(x_mm, y_mm), 1e-12)
    return away, np.maximum(np.hypot(x_mm * box_mm[0], y_mm * box_mm[1]) / away, min(box_mm))


def corners_of(extent_mm: tuple[float, float, float, float]) -> Floats:
    """Corners (4, 2) of left, top, right, bottom, clockwise."""
    left, top, right, bottom = extent_mm
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])


def within_box(extent_mm: tuple[float, float, float, float], x_mm: Floats, y_mm: Floats) -> Floats:
    """How far inside left, top, right, bottom places are, negative outside."""
    left, top, right, bottom = extent_mm
    across, down = np.minimum(x_mm - left, right - x_mm), np.minimum(y_mm - top, bottom - y_mm)
    return np.minimum(across, down)


def inside_share(within: Floats, box: float | Floats) -> Floats:
    """Share of a soft box inside an edge ``within`` away (positive: inside).

    Soft: a hat of twice the box's width. Hats at the box's pitch add up to one and keep the
    place of an edge exactly; boxes let it wander with the edge's slope.
    """
    t = np.clip(within / box, -1.0, 1.0)
    return np.asarray(0.5 + t - 0.5 * t * np.abs(t))


def split_cells(place: Floats, box: float | Floats) -> list[tuple[Ints, Floats]]:
    """The two cells of unit length nearest to each place, and the soft box's share in each."""
    border = np.rint(place)
    low = border.astype(np.int64) - 1
    upper = inside_share(place - border, box)
    return [(low, 1.0 - upper), (low + 1, upper)]


@dataclass(frozen=True, eq=False)
class PlatePattern:
    """A ChArUco plate: squares, and markers within the white ones."""

    plate: CharucoPlate
    squares: ModulePattern
    modules: Bools
    """White modules of all markers, (rows * size, columns * size), square by square."""

    @property
    def extent_mm(self) -> tuple[float, float, float, float]:
        """Left, top, right, bottom with the border."""
        return self.squares.extent_mm

    @property
    def outline_mm(self) -> Floats:
        """Corners of the border."""
        return corners_of(self.extent_mm)

    @property
    def finest_mm(self) -> float:
        """Side of a marker's module, or half the margin round it."""
        margin = (self.plate.square_mm - self.plate.marker_mm) / 4.0
        return min(self.plate.marker_mm / self._modules_per_marker, margin)

    def within_mm(self, x_mm: Floats, y_mm: Floats) -> Floats:
        """Distance to the nearest edge of the border."""
        return within_box(self.extent_mm, x_mm, y_mm)

    @property
    def _modules_per_marker(self) -> int:
        return len(self.modules) // self.plate.rows

    def white_share(self, x_mm: Floats, y_mm: Floats, box_mm: tuple[float, float]) -> Floats:
        """Share of white in boxes about the places."""
        share = self.squares.white_share(x_mm, y_mm, box_mm)
        square, side = self.plate.square_mm, self.plate.marker_mm
        column, row = np.floor(x_mm / square), np.floor(y_mm / square)
        margin = (square - side) / 2.0
        inner_x, inner_y = x_mm - column * square - margin, y_mm - row * square - margin
        # Boxes are far smaller than margins: one that touches a marker lies in its square.
        near_x = (inner_x > -margin / 2.0) & (inner_x < side + margin / 2.0)
        near_y = (inner_y > -margin / 2.0) & (inner_y < side + margin / 2.0)
        plate = self.plate
        on = near_x & near_y & (column >= 0) & (column < plate.columns)
        on &= (row >= 0) & (row < plate.rows)
        if not on.any():
            return share
        size = self._modules_per_marker
        place, inside = (column[on], row[on]), (inner_x[on], inner_y[on])
        marker = black_of_modules(self.modules, size, side / size, place, inside, box_mm)
        share[on] += marker if plate.inverted else -marker
        return share


def black_of_modules(
    white: Bools,
    size: int,
    module_mm: float,
    place: tuple[Floats, Floats],
    inside_mm: tuple[Floats, Floats],
    box_mm: tuple[float, float],
) -> Floats:
    """Share of black (n,) that markers of ``size`` modules each way put into boxes.

    ``white``: the modules of all markers side by side. ``place``: column and row of the marker
    that each box is nearest to, ``inside_mm``: where the box is in it.
    """
    (column, row), (x, y) = place, inside_mm
    black = np.zeros(len(x))
    for i, i_part in split_cells(y / module_mm, box_mm[1] / module_mm):
        for j, j_part in split_cells(x / module_mm, box_mm[0] / module_mm):
            on = (i >= 0) & (i < size) & (j >= 0) & (j < size)
            at_row = row.astype(np.int64) * size + np.clip(i, 0, size - 1)
            at_column = column.astype(np.int64) * size + np.clip(j, 0, size - 1)
            black += np.where(on & ~white[at_row, at_column], i_part * j_part, 0.0)
    return black


def plate_pattern(plate: CharucoPlate, border_mm: float | None = None) -> PlatePattern:
    """What a plate looks like; by default with a white border of a quarter square."""
    border = plate.square_mm / 4.0 if border_mm is None else border_mm
    white = np.array(
        [[plate.is_white(c, r) for c in range(plate.columns)] for r in range(plate.rows)]
    )
    squares = ModulePattern(white, plate.square_mm, (0.0, 0.0), border, inverted=plate.inverted)
    size = opencv.marker_modules(plate.dictionary, plate.first_marker).shape[0]
    modules = np.ones((plate.rows * size, plate.columns * size), dtype=bool)
    for number, (column, row) in enumerate(plate.marker_squares, plate.first_marker):
        at = slice(row * size, (row + 1) * size), slice(column * size, (column + 1) * size)
        modules[at] = opencv.marker_modules(plate.dictionary, number)
    return PlatePattern(plate, squares, modules)


def marker_pattern(carrier: MarkerCarrier, number: int) -> ModulePattern:
    """What one marker of a carrier looks like, its middle at the origin."""
    white = opencv.marker_modules(carrier.dictionary, number)
    module = carrier.size_mm / len(white)
    corner = -carrier.size_mm / 2.0
    return ModulePattern(white, module, (corner, corner), module, carrier.dot, carrier.inverted)


def ring_pattern(carrier: RingCarrier, number: int) -> RingPattern:
    """What one ring target of a carrier looks like, its dot at the origin."""
    word = carrier.family.word(number)
    return RingPattern(word, carrier.family.bits, carrier.dot_radius_mm, carrier.inverted)
