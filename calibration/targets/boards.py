"""Boards that people own already: plain chessboards, Kalibr's AprilGrids, grids of dots.

All lie in a frame with x right, y down, z into the board, lengths as drawn. A board without ids
that looks the same after half a turn is taken only when it is promised to be held upright.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from calibration.observations import Carrier
from calibration.targets.rulers import Ruler, require
from geometry.arrays import Bools, Floats

MOST_SQUARES = 100
UPRIGHT_DEG, UPRIGHT_SQUARE_DEG = 60.0, 30.0
"""How far an upright board may be turned in a picture; less where a quarter turn looks alike."""


@dataclass(frozen=True, kw_only=True)
class Board:
    """What all boards have: one flat sheet, its points in rows.

    ``inverted``: black and white exchanged. ``sigma_mm`` (x, y, z) of each point.
    """

    name: str
    inverted: bool = False
    fixed: bool = False
    sigma_mm: tuple[float, float, float] = (0.02, 0.02, 0.1)
    ruler: Ruler | None = None

    @property
    def scale(self) -> float:
        """Printed over drawn size."""
        return 1.0 if self.ruler is None else self.ruler.scale

    @property
    def grid_mm(self) -> Floats:
        """The points (m, 2) that are measured, as drawn."""
        raise NotImplementedError

    @property
    def ids(self) -> tuple[str, ...]:
        """Names of the points."""
        return tuple(f"{self.name}-{k:03d}" for k in range(len(self.grid_mm)))

    def carrier(self) -> Carrier:
        """The board as calibration sees it, at its printed size."""
        grid = self.grid_mm * self.scale
        nominal = np.column_stack([grid, np.zeros(len(grid))])
        return Carrier(
            self.name, self.ids, nominal, np.broadcast_to(self.sigma_mm, nominal.shape), self.fixed
        )


@dataclass(frozen=True, kw_only=True)
class Chessboard(Board):
    """A plain chessboard of ``columns`` x ``rows`` squares, the upper left one black.

    Its targets are the inner corners, row by row. ``upright``: it is held upright in every
    picture, which boards need that half a turn does not change.
    """

    columns: int
    rows: int
    square_mm: float
    upright: bool = False

    def __post_init__(self) -> None:
        require(
            min(self.columns, self.rows) >= 4 and max(self.columns, self.rows) <= MOST_SQUARES,
            "chessboard-squares",
            f"chessboard {self.name!r} has {self.columns} x {self.rows} squares",
            f"give 4 to {MOST_SQUARES} squares each way, one more than inner corners",
        )
        _require_length(self.name, "square_mm", self.square_mm)
        require(
            self.upright or (self.columns + self.rows) % 2 == 1,
            "board-turned",
            f"chessboard {self.name!r} of {self.columns} x {self.rows} squares looks the same when "
            "it is turned by half a turn",
            "take an odd number of squares one way and an even number the other, or set "
            f"upright = true if it is held upright within {self.upright_deg:g} degrees in all "
            "pictures",
        )

    @property
    def upright_deg(self) -> float:
        """How far it may be turned in a picture when it must be upright."""
        alike = self.columns == self.rows and self.columns % 2 == 1
        return UPRIGHT_SQUARE_DEG if alike else UPRIGHT_DEG

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the squares."""
        return self.columns * self.square_mm, self.rows * self.square_mm

    @property
    def white(self) -> Bools:
        """Which squares are white, (rows, columns)."""
        row, column = np.indices((self.rows, self.columns))
        return np.asarray((row + column) % 2 == 1)

    @property
    def grid_mm(self) -> Floats:
        """Inner corners (m, 2) from the outer corner of the first square."""
        x, y = np.meshgrid(np.arange(1, self.columns), np.arange(1, self.rows))
        return np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float64) * self.square_mm


@dataclass(frozen=True, kw_only=True)
class AprilGrid(Board):
    """Kalibr's AprilGrid: ``columns`` x ``rows`` tags with black squares between their corners.

    ``tag_mm`` is the side of a tag, ``gap_mm`` between tags: Kalibr's ``tagSize``, and its
    ``tagSpacing`` times that. Tags are numbered from ``first_tag`` in the lower left corner to the
    right and then upwards, or downwards from the upper left corner with ``from_top``.
    ``border_modules``: how wide a tag's black border is. ``tag_turn_deg``: how far tags are turned
    against OpenCV's pictures of them. Its targets are the corners of the tags: upper left, upper
    right, lower right, lower left of each, from the upper left corner of the upper left tag.
    """

    columns: int
    rows: int
    tag_mm: float
    gap_mm: float
    dictionary: str = "DICT_APRILTAG_36H11"
    first_tag: int = 0
    from_top: bool = False
    border_modules: Literal[1, 2] = 2
    tag_turn_deg: Literal[0, 90, 180, 270] = 180

    def __post_init__(self) -> None:
        require(
            min(self.columns, self.rows) >= 1
            and 2 <= max(self.columns, self.rows) <= MOST_SQUARES
            and self.first_tag >= 0,
            "aprilgrid-tags",
            f"AprilGrid {self.name!r} has {self.columns} x {self.rows} tags from {self.first_tag}",
            f"give 1 to {MOST_SQUARES} tags each way, two at least, and a first tag of 0 or more",
        )
        _require_length(self.name, "tag_mm", self.tag_mm)
        _require_length(self.name, "gap_mm", self.gap_mm)
        require(
            self.gap_mm < self.tag_mm,
            "aprilgrid-gap",
            f"AprilGrid {self.name!r} has gaps of {self.gap_mm:g} mm between tags of "
            f"{self.tag_mm:g} mm",
            "give gap_mm smaller than tag_mm: Kalibr's tagSpacing times its tagSize",
        )
        object.__setattr__(self, "dictionary", self.dictionary.upper())

    @property
    def pitch_mm(self) -> float:
        """From tag to tag."""
        return self.tag_mm + self.gap_mm

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the tags, without the squares round them."""
        width, height = (n * self.pitch_mm - self.gap_mm for n in (self.columns, self.rows))
        return width, height

    @property
    def places(self) -> tuple[tuple[int, int], ...]:
        """Column and row, from the upper left, of each tag in the order of their numbers."""
        rows = range(self.rows) if self.from_top else range(self.rows - 1, -1, -1)
        return tuple((column, row) for row in rows for column in range(self.columns))

    @property
    def corners_mm(self) -> Floats:
        """Corners (tags, 4, 2), clockwise from the upper left one."""
        low = np.array(self.places, dtype=np.float64)[:, None] * self.pitch_mm
        return np.asarray(low + self.tag_mm * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]))

    @property
    def grid_mm(self) -> Floats:
        """Corners (m, 2), tag by tag."""
        return self.corners_mm.reshape(-1, 2)

    @property
    def ids(self) -> tuple[str, ...]:
        """Names of the corners: tag and corner."""
        numbers = range(self.first_tag, self.first_tag + self.columns * self.rows)
        return tuple(f"{self.name}-{n:03d}-{k}" for n in numbers for k in range(4))


@dataclass(frozen=True, kw_only=True)
class DotGrid(Board):
    """A grid of round dots: ``columns`` in each of ``rows`` rows, ``spacing_mm`` between rows.

    In a symmetric grid dots of a row are ``spacing_mm`` apart. In an ``asymmetric`` one they are
    twice that apart, and every other row is shifted by ``spacing_mm``, as OpenCV has it. The first
    dot is the origin. ``upright`` as in a :class:`Chessboard`.
    """

    columns: int
    rows: int
    spacing_mm: float
    dot_radius_mm: float
    asymmetric: bool = False
    upright: bool = False

    def __post_init__(self) -> None:
        require(
            min(self.columns, self.rows) >= 3 and max(self.columns, self.rows) <= MOST_SQUARES,
            "dots-number",
            f"dot grid {self.name!r} has {self.columns} x {self.rows} dots",
            f"give 3 to {MOST_SQUARES} each way",
        )
        _require_length(self.name, "spacing_mm", self.spacing_mm)
        _require_length(self.name, "dot_radius_mm", self.dot_radius_mm)
        require(
            self.dot_radius_mm <= 0.4 * self.spacing_mm,
            "dots-radius",
            f"the dots of {self.name!r} have a radius of {self.dot_radius_mm:g} mm at a spacing of "
            f"{self.spacing_mm:g} mm",
            "give the radius, not the diameter; at most 0.4 of the spacing",
        )
        require(
            self.upright or (self.asymmetric and self.rows % 2 == 1),
            "board-turned",
            f"dot grid {self.name!r} looks the same when it is turned by half a turn",
            "take an asymmetric grid with an odd number of rows, or set upright = true if it is "
            f"held upright within {self.upright_deg:g} degrees in all pictures",
        )

    @property
    def upright_deg(self) -> float:
        """How far it may be turned in a picture when it must be upright."""
        alike = self.columns == self.rows and not self.asymmetric
        return UPRIGHT_SQUARE_DEG if alike else UPRIGHT_DEG

    @property
    def grid_mm(self) -> Floats:
        """Middles of the dots (m, 2)."""
        row, column = (v.ravel() for v in np.indices((self.rows, self.columns)))
        across = 2 * column + row % 2 if self.asymmetric else column
        return np.stack([across, row], axis=1).astype(np.float64) * self.spacing_mm

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height, first to last middle."""
        width, height = self.grid_mm.max(axis=0)
        return float(width), float(height)


AnyBoard = Chessboard | AprilGrid | DotGrid


def _require_length(name: str, key: str, value: float) -> None:
    require(
        bool(np.isfinite(value)) and value > 0.0,
        "board-size",
        f"{key} = {value:g} of board {name!r} is no length",
        "give millimetres",
    )
