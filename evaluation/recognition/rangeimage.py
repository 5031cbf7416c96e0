"""Range images: how far a face stands out at each place of a grid in its own coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter, median_filter

from geometry.arrays import Bools, Floats, Ints

_LEAST_WEIGHT = 0.15
"""A place with less than this of a point near it is a hole."""

_STRAY_MM = 8.0
_MEDIAN_CELLS = 5
_LAYER_MM = 6.0
"""For each millimetre of the step: steep flanks are one layer."""

_REACH = 2


@dataclass(frozen=True)
class Grid:
    """Places ``step_mm`` apart: x within ``half_width_mm``, z from ``low_mm`` to ``high_mm``."""

    step_mm: float
    half_width_mm: float
    low_mm: float
    high_mm: float

    @property
    def x_mm(self) -> Floats:
        """Of the columns, (w,); symmetric about zero."""
        half = round(self.half_width_mm / self.step_mm)
        return np.asarray(self.step_mm * np.arange(-half, half + 1))

    @property
    def z_mm(self) -> Floats:
        """Of the rows, (h,), upwards."""
        first, last = round(self.low_mm / self.step_mm), round(self.high_mm / self.step_mm)
        return np.asarray(self.step_mm * np.arange(first, last + 1))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return len(self.z_mm), len(self.x_mm)


FACE_GRID = Grid(1.0, 60.0, -65.0, 75.0)
"""From chin to forehead, about the tip of the nose."""


def range_image(points_mm: Floats, grid: Grid) -> Floats:
    """How far the surface of points (n, 3) stands out, mm, (h, w); NaN where nothing is near.

    Points are in the face's own frame: x to its left, y into the head, z up, and of one layer
    (:func:`foremost`). At each place a plane is fitted to the points about it, weighted by a
    Gaussian of one step (moving least squares), so that uneven density shifts nothing.
    """
    column = (points_mm[:, 0] - grid.x_mm[0]) / grid.step_mm
    row = (points_mm[:, 2] - grid.z_mm[0]) / grid.step_mm
    inside = _inside(row, column, grid)
    return _fitted(row[inside], column[inside], -points_mm[inside, 1], grid.shape)


def foremost(points_mm: Floats, grid: Grid) -> Bools:
    """Which points (n, 3) within the grid lie on the outermost surface and are no strays, (n,)."""
    out = np.zeros(len(points_mm), dtype=np.bool_)
    height = -points_mm[:, 1]
    column = (points_mm[:, 0] - grid.x_mm[0]) / grid.step_mm
    row = (points_mm[:, 2] - grid.z_mm[0]) / grid.step_mm
    rows, columns = grid.shape
    inside = np.flatnonzero(_inside(row, column, grid))
    cell, height = _cells(row[inside], column[inside], columns), height[inside]
    top = _highest(cell, height, rows * columns)
    known = np.isfinite(top).reshape(rows, columns)
    # A lone point in front of the face would hide what is behind it.
    kept = height <= _median(top.reshape(rows, columns), known).ravel()[cell] + _STRAY_MM
    inside, cell, height = inside[kept], cell[kept], height[kept]
    kept = height >= _highest(cell, height, rows * columns)[cell] - _LAYER_MM * grid.step_mm
    out[inside[kept]] = True
    return out


def _inside(row: Floats, column: Floats, grid: Grid) -> Bools:
    rows, columns = grid.shape
    return np.asarray(
        (row > -0.5) & (row < rows - 0.5) & (column > -0.5) & (column < columns - 0.5)
    )


def _highest(cell: Ints, height: Floats, count: int) -> Floats:
    top = np.full(count, -np.inf)
    np.maximum.at(top, cell, height)
    return top


def _cells(row: Floats, column: Floats, columns: int) -> Ints:
    return np.rint(row).astype(np.int64) * columns + np.rint(column).astype(np.int64)


def _median(level: Floats, known: Bools) -> Floats:
    """The median about each place; what is not known counts as the nearest that is."""
    if not known.any():
        return np.zeros(level.shape)
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(median_filter(level[tuple(nearest)], _MEDIAN_CELLS, mode="nearest"))


def _fitted(row: Floats, column: Floats, height: Floats, shape: tuple[int, int]) -> Floats:
    """Planes by moving least squares: sums about each cell, smoothed, solved for its middle."""
    cell = _cells(row, column, shape[1])
    i, j = np.rint(row), np.rint(column)
    u, v = row - i, column - j
    size = shape[0] * shape[1]

    def summed(values: Floats) -> Floats:
        return np.bincount(cell, values, size).astype(np.float64).reshape(shape)

    # Sums in coordinates of the whole grid would lose digits; each cell's own are moved later.
    basis = [np.ones_like(u), u, v, u * u, u * v, v * v, height, u * height, v * height]
    s = _about([summed(b) for b in basis])
    normal = np.empty((*shape, 3, 3))
    normal[..., 0, 0], normal[..., 0, 1], normal[..., 0, 2] = s[0], s[1], s[2]
    normal[..., 1, 1], normal[..., 1, 2], normal[..., 2, 2] = s[3], s[4], s[5]
    normal[..., 1, 0], normal[..., 2, 0] = s[1], s[2]
    normal[..., 2, 1] = s[4]
    weight = s[0]
    known = weight >= _LEAST_WEIGHT
    # Where all points are on one side the slope is held, not extrapolated.
    normal[..., 1, 1] += 0.05 * weight + 1e-9
    normal[..., 2, 2] += 0.05 * weight + 1e-9
    normal[..., 0, 0] += 1e-12
    right = np.stack(s[6:], axis=-1)
    image = np.full(shape, np.nan)
    image[known] = np.linalg.solve(normal[known], right[known][..., None])[:, 0, 0]
    return image


def _about(sums: list[Floats]) -> list[Floats]:
    """Gaussian sums of the moments, each moved to the middle of the cell that it is taken to."""
    n, u, v, uu, uv, vv, h, uh, vh = sums
    n, u, v, uu, uv, vv, h, uh, vh = _along(0, n, u, v, uu, uv, vv, h, uh, vh)
    n, v, u, vv, uv, uu, h, vh, uh = _along(1, n, v, u, vv, uv, uu, h, vh, uh)
    return [n, u, v, uu, uv, vv, h, uh, vh]


def _along(axis: int, *moments: Floats) -> list[Floats]:
    """The sums along one axis, whose coordinate is the first of the two."""
    out = [np.zeros_like(m) for m in moments]
    pad = [(_REACH, _REACH) if k == axis else (0, 0) for k in range(2)]
    padded = [np.pad(m, pad) for m in moments]
    count = moments[0].shape[axis]
    for a in range(-_REACH, _REACH + 1):
        part = [np.take(m, range(_REACH + a, _REACH + a + count), axis) for m in padded]
        n, u, v, uu, uv, vv, h, uh, vh = part
        weight = float(np.exp(-0.5 * a * a))
        moved = (
            *(n, u + a * n, v, uu + 2 * a * u + a * a * n, uv + a * v, vv),
            *(h, uh + a * h, vh),
        )
        for total, value in zip(out, moved, strict=True):
            total += weight * value
    return out


def smoothed(image: Floats, sigma_cells: float) -> Floats:
    """The image (h, w) blurred over what is known; holes stay."""
    known = np.isfinite(image)
    weight = gaussian_filter(known.astype(np.float64), sigma_cells)
    total = gaussian_filter(np.where(known, image, 0.0), sigma_cells)
    return np.where(known, total / np.maximum(weight, 1e-9), np.nan)
