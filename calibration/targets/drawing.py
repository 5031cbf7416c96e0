"""Targets as outlines, in millimetres from the upper left corner of the paper."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from calibration.targets.boardpatterns import board_pattern, tag_modules
from calibration.targets.boards import AnyBoard, AprilGrid, Chessboard
from calibration.targets.kinds import (
    DOT_CLEAR_MODULES,
    DOT_RADIUS_MODULES,
    RING_INNER,
    RING_OUTER,
    CharucoPlate,
    MarkerCarrier,
    RingCarrier,
)
from calibration.targets.patterns import (
    Pattern,
    marker_pattern,
    plate_pattern,
    ring_pattern,
)
from geometry.arrays import Bools, Floats

_ROUND = 256
"""Sides of a circle: it is off by less than a ten-thousandth of its radius."""


@dataclass(frozen=True, eq=False)
class Area:
    """Polygons (n, 2) of one colour, filled as one: where they touch there is no seam."""

    polygons: tuple[Floats, ...]
    black: bool = True


@dataclass(frozen=True)
class Label:
    """A line of text, its baseline's left end at a place."""

    x_mm: float
    y_mm: float
    height_mm: float
    text: str


@dataclass(frozen=True, eq=False)
class Drawing:
    """One page: areas one over the other, then labels."""

    width_mm: float
    height_mm: float
    areas: tuple[Area, ...] = field(default=())
    labels: tuple[Label, ...] = field(default=())


def rectangle(left: float, top: float, right: float, bottom: float) -> Floats:
    """Corners (4, 2)."""
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])


def plate_areas(plate: CharucoPlate, corner_mm: Floats) -> Iterator[Area]:
    """A plate, its first square's outer corner at ``corner_mm``."""
    pattern = plate_pattern(plate)
    if plate.inverted:
        yield _backing(pattern, corner_mm)
    polygons = _runs(~pattern.squares.white, plate.square_mm, corner_mm)
    size = len(pattern.modules) // plate.rows
    module = plate.marker_mm / size
    margin = (plate.square_mm - plate.marker_mm) / 2.0
    for column, row in plate.marker_squares:
        at = slice(row * size, (row + 1) * size), slice(column * size, (column + 1) * size)
        place = corner_mm + np.array([column, row]) * plate.square_mm + margin
        polygons += _runs(~pattern.modules[at], module, place)
    yield Area(tuple(polygons), not plate.inverted)


def board_areas(board: AnyBoard, corner_mm: Floats) -> Iterator[Area]:
    """A chessboard, AprilGrid or dot grid, the origin of its frame at ``corner_mm``."""
    if board.inverted:
        yield _backing(board_pattern(board), corner_mm)
    if isinstance(board, Chessboard):
        polygons = _runs(~board.white, board.square_mm, corner_mm)
    elif isinstance(board, AprilGrid):
        polygons = _tags(board, corner_mm)
    else:
        circle = _sector(board.dot_radius_mm, 0.0, 1.0)
        polygons = [circle + place + corner_mm for place in board.grid_mm]
    yield Area(tuple(polygons), not board.inverted)


def _tags(grid: AprilGrid, corner_mm: Floats) -> list[Floats]:
    polygons: list[Floats] = []
    for number, (column, row) in enumerate(grid.places, grid.first_tag):
        modules = tag_modules(grid, number)
        place = corner_mm + np.array([column, row]) * grid.pitch_mm
        polygons += _runs(~modules, grid.tag_mm / len(modules), place)
    square = rectangle(-grid.gap_mm, -grid.gap_mm, 0.0, 0.0)
    for row in range(grid.rows + 1):
        for column in range(grid.columns + 1):
            polygons.append(square + corner_mm + np.array([column, row]) * grid.pitch_mm)
    return polygons


def marker_areas(carrier: MarkerCarrier, number: int, middle_mm: Floats) -> Iterator[Area]:
    """One marker of a carrier about ``middle_mm``."""
    pattern = marker_pattern(carrier, number)
    black = not carrier.inverted
    if carrier.inverted:
        yield _backing(pattern, middle_mm)
    corner = middle_mm + np.array(pattern.origin_mm)
    yield Area(tuple(_runs(~pattern.white, pattern.module_mm, corner)), black)
    if carrier.dot:
        clear = DOT_CLEAR_MODULES * pattern.module_mm
        yield Area((_sector(clear, 0.0, 1.0) + middle_mm,), not black)
        yield Area((_sector(DOT_RADIUS_MODULES * pattern.module_mm, 0.0, 1.0) + middle_mm,), black)


def ring_areas(carrier: RingCarrier, number: int, middle_mm: Floats) -> Iterator[Area]:
    """One ring target of a carrier about ``middle_mm``."""
    pattern, radius = ring_pattern(carrier, number), carrier.dot_radius_mm
    if carrier.inverted:
        yield _backing(pattern, middle_mm)
    polygons = [_sector(radius, 0.0, 1.0)]
    for first, count in _black_arcs(pattern.word, pattern.bits):
        start, end = first / pattern.bits, (first + count) / pattern.bits
        outer = _sector(RING_OUTER * radius, start, end)
        inner = _sector(RING_INNER * radius, start, end)
        polygons.append(np.concatenate([outer, inner[::-1]]))
    yield Area(tuple(p + middle_mm for p in polygons), not carrier.inverted)


def _backing(pattern: Pattern, place_mm: Floats) -> Area:
    """The black paper of a target that is white on black."""
    return Area((rectangle(*pattern.extent_mm) + place_mm,))


def _runs(black: Bools, module_mm: float, corner_mm: Floats) -> list[Floats]:
    """Black modules as rectangles, those side by side in a row as one."""
    out = []
    for row, line in enumerate(black):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], line, [False]]).astype(int)))
        for start, end in edges.reshape(-1, 2):
            box = rectangle(float(start), float(row), float(end), row + 1.0)
            out.append(box * module_mm + corner_mm)
    return out


def _sector(radius: float, start: float, end: float) -> Floats:
    """Points on a circle from one share of a turn to another; a whole turn closes itself."""
    count = max(2, round(_ROUND * (end - start)) + 1)
    turn = 2.0 * np.pi * np.linspace(start, end, count, endpoint=end - start < 1.0)
    return np.asarray(radius * np.stack([np.cos(turn), np.sin(turn)], axis=1))


def _black_arcs(word: int, bits: int) -> Iterator[tuple[int, int]]:
    """First sector and length of each run of ones round the ring."""
    ones = [(word >> k) & 1 for k in range(bits)]
    for first in range(bits):
        if ones[first] and not ones[first - 1]:
            count = 1
            while ones[(first + count) % bits]:
                count += 1
            yield first, count
