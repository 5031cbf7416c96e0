"""How boards of others look: chessboards, AprilGrids, grids of dots."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calibration.detection import opencv
from calibration.targets.boards import AnyBoard, AprilGrid, Chessboard
from calibration.targets.patterns import (
    ModulePattern,
    Pattern,
    black_of_modules,
    corners_of,
    inside_share,
    within_box,
)
from geometry.arrays import Bools, Floats

Box = tuple[float, float, float, float]


def board_pattern(board: AnyBoard) -> Pattern:
    """What a board looks like, with white paper round it."""
    if isinstance(board, Chessboard):
        border = board.square_mm / 2.0
        return ModulePattern(
            board.white, board.square_mm, (0.0, 0.0), border, inverted=board.inverted
        )
    if isinstance(board, AprilGrid):
        return GridPattern(board)
    step = board.spacing_mm
    far = (board.columns - 1) * step * (2.0 if board.asymmetric else 1.0), (board.rows - 1) * step
    lattices: tuple[Lattice, ...] = ((0.0, 0.0, step, step, board.columns, board.rows),)
    if board.asymmetric:
        odd = board.rows // 2
        lattices = (
            (0.0, 0.0, 2.0 * step, 2.0 * step, board.columns, board.rows - odd),
            (step, step, 2.0 * step, 2.0 * step, board.columns, odd),
        )
        far = far[0] + step, far[1]
    extent = -step, -step, far[0] + step, far[1] + step
    return DotsPattern(lattices, board.dot_radius_mm, extent, board.inverted)


def tag_modules(grid: AprilGrid, number: int) -> Bools:
    """White modules of one tag as it stands on the board, with its border."""
    modules = opencv.marker_modules(grid.dictionary, number)
    return np.rot90(np.pad(modules, grid.border_modules - 1), -grid.tag_turn_deg // 90)


Lattice = tuple[float, float, float, float, int, int]
"""First place x, y; step x, y; columns and rows."""


@dataclass(frozen=True, eq=False)
class DotsPattern:
    """Dots of one radius on lattices that keep their dots apart."""

    lattices: tuple[Lattice, ...]
    dot_radius_mm: float
    extent_mm: Box
    inverted: bool = False

    @property
    def outline_mm(self) -> Floats:
        """Corners of the paper."""
        return corners_of(self.extent_mm)

    @property
    def finest_mm(self) -> float:
        """The radius."""
        return self.dot_radius_mm

    def within_mm(self, x_mm: Floats, y_mm: Floats) -> Floats:
        """Distance to the nearest edge of the paper."""
        return within_box(self.extent_mm, x_mm, y_mm)

    def white_share(self, x_mm: Floats, y_mm: Floats, box_mm: tuple[float, float]) -> Floats:
        """Share of white in boxes about the places."""
        black = np.zeros(np.shape(x_mm))
        for left, top, step_x, step_y, columns, rows in self.lattices:
            column = np.clip(np.rint((x_mm - left) / step_x), 0, columns - 1)
            row = np.clip(np.rint((y_mm - top) / step_y), 0, rows - 1)
            x, y = x_mm - left - column * step_x, y_mm - top - row * step_y
            away = np.maximum(np.hypot(x, y), 1e-12)
            box = np.maximum(np.hypot(x * box_mm[0], y * box_mm[1]) / away, min(box_mm))
            black += inside_share(self.dot_radius_mm - away, box)
        return black if self.inverted else 1.0 - black


@dataclass(frozen=True, eq=False)
class GridPattern:
    """An AprilGrid: tags, and a black square at every corner of every tag."""

    grid: AprilGrid

    @cached_property
    def modules(self) -> Bools:
        """White modules of all tags, (rows * size, columns * size), as they stand."""
        grid = self.grid
        tags = [tag_modules(grid, grid.first_tag + k) for k in range(len(grid.places))]
        size = len(tags[0])
        white = np.ones((grid.rows * size, grid.columns * size), dtype=bool)
        for (column, row), tag in zip(grid.places, tags, strict=True):
            white[row * size : (row + 1) * size, column * size : (column + 1) * size] = tag
        return white

    @property
    def extent_mm(self) -> Box:
        """Left, top, right, bottom of the paper: half a gap round the outer squares."""
        reach, (width, height) = 1.5 * self.grid.gap_mm, self.grid.size_mm
        return -reach, -reach, width + reach, height + reach

    @property
    def outline_mm(self) -> Floats:
        """Corners of the paper."""
        return corners_of(self.extent_mm)

    @property
    def finest_mm(self) -> float:
        """A tag's module, or the gap."""
        return min(self.grid.tag_mm / self._size, self.grid.gap_mm)

    def within_mm(self, x_mm: Floats, y_mm: Floats) -> Floats:
        """Distance to the nearest edge of the paper."""
        return within_box(self.extent_mm, x_mm, y_mm)

    @property
    def _size(self) -> int:
        return len(self.modules) // self.grid.rows

    def white_share(self, x_mm: Floats, y_mm: Floats, box_mm: tuple[float, float]) -> Floats:
        """Share of white in boxes about the places."""
        grid = self.grid
        squares = _stripes(x_mm, grid, grid.columns, box_mm[0])
        squares *= _stripes(y_mm, grid, grid.rows, box_mm[1])
        # Boxes are far smaller than gaps: one that touches a tag is nearest to that tag.
        middle = grid.tag_mm / 2.0
        column = np.clip(np.rint((x_mm - middle) / grid.pitch_mm), 0, grid.columns - 1)
        row = np.clip(np.rint((y_mm - middle) / grid.pitch_mm), 0, grid.rows - 1)
        x, y = x_mm - column * grid.pitch_mm, y_mm - row * grid.pitch_mm
        near = (np.maximum(abs(x - middle), abs(y - middle)) - middle) < grid.gap_mm / 2.0
        black = squares
        module_mm = grid.tag_mm / self._size
        place, inside = (column[near], row[near]), (x[near], y[near])
        black[near] += black_of_modules(self.modules, self._size, module_mm, place, inside, box_mm)
        return black if grid.inverted else 1.0 - black


def _stripes(place: Floats, grid: AprilGrid, count: int, box: float) -> Floats:
    """Share of boxes along one axis in the gaps before, between and after ``count`` tags."""
    middle = np.clip(np.rint((place + grid.gap_mm / 2.0) / grid.pitch_mm), 0, count)
    away = np.abs(place - middle * grid.pitch_mm + grid.gap_mm / 2.0)
    return inside_share(grid.gap_mm / 2.0 - away, box)
