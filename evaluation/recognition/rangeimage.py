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

    Points are in the face's own frame: x to its left, y into the head, z up. At each place a
    plane is fitted to the points about it, weighted by a Gaussian of one step (moving least
    squares), so that uneven density shifts nothing; of several layers the foremost counts.
    """
    row, column, height = _front_layer(points_mm, grid)
    return _fitted(row, column, height, grid.shape)


def _front_layer(points_mm: Floats, grid: Grid) -> tuple[Floats, Floats, Floats]:
    """Rows, columns (in steps) and heights of the points on the outermost surface."""
    height = -points_mm[:, 1]
    column = (points_mm[:, 0] - grid.x_mm[0]) / grid.step_mm
    row = (points_mm[:, 2] - grid.z_mm[0]) / grid.step_mm
    rows, columns = grid.shape
    inside = (row > -0.5) & (row < rows - 0.5) & (column > -0.5) & (column < columns - 0.5)
    row, column, height = row[inside], column[inside], height[inside]
    cell = _cells(row, column, columns)
    top = _highest(cell, height, rows * columns)
    known = np.isfinite(top).reshape(rows, columns)
    # A lone point in front of the face would hide what is behind it.
    kept = height <= _median(top.reshape(rows, columns), known).ravel()[cell] + _STRAY_MM
    row, column, height, cell = row[kept], column[kept], height[kept], cell[kept]
    kept = height >= _highest(cell, height, rows * columns)[cell] - _LAYER_MM
    return row[kept], column[kept], height[kept]


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
    reach = range(-2, 3)
    out = [np.zeros_like(sums[0]) for _ in sums]
    n, u, v, uu, uv, vv, h, uh, vh = (np.pad(s, 2) for s in sums)
    rows, columns = sums[0].shape
    for a in reach:
        for b in reach:
            w = float(np.exp(-0.5 * (a * a + b * b)))
            part = (slice(2 + a, 2 + a + rows), slice(2 + b, 2 + b + columns))
            n_, u_, v_, h_ = n[part], u[part], v[part], h[part]
            moved = (
                n_, u_ + a * n_, v_ + b * n_,
                uu[part] + 2 * a * u_ + a * a * n_,
                uv[part] + a * v_ + b * u_ + a * b * n_,
                vv[part] + 2 * b * v_ + b * b * n_,
                h_, uh[part] + a * h_, vh[part] + b * h_,
            )  # fmt: skip
            for total, value in zip(out, moved, strict=True):
                total += w * value
    return out


def smoothed(image: Floats, sigma_cells: float) -> Floats:
    """The image (h, w) blurred over what is known; holes stay."""
    known = np.isfinite(image)
    weight = gaussian_filter(known.astype(np.float64), sigma_cells)
    total = gaussian_filter(np.where(known, image, 0.0), sigma_cells)
    return np.where(known, total / np.maximum(weight, 1e-9), np.nan)
