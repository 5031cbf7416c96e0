"""Residuals of one camera as means over cells of its image: small, and patterns show in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats

COLUMNS, ROWS = 9, 6


@dataclass(frozen=True)
class GridCell:
    """Mean place and mean residual of the ``points`` in one cell, px."""

    x_px: float
    y_px: float
    dx_px: float
    dy_px: float
    points: int


def residual_grid(
    pixels: Floats, residuals: Floats, size_px: tuple[int, int]
) -> tuple[GridCell, ...]:
    """Cells with points in them, of image points and their residuals (n, 2)."""
    share = (pixels + 0.5) / np.array(size_px)
    column = np.clip((share[:, 0] * COLUMNS).astype(np.int64), 0, COLUMNS - 1)
    row = np.clip((share[:, 1] * ROWS).astype(np.int64), 0, ROWS - 1)
    cell = row * COLUMNS + column
    out = []
    for k in np.unique(cell):
        own = cell == k
        x, y = pixels[own].mean(axis=0)
        dx, dy = residuals[own].mean(axis=0)
        # Hundredths of a pixel in place and microns in residual are more than any plot shows.
        place = round(float(x), 2), round(float(y), 2)
        out.append(GridCell(*place, round(float(dx), 5), round(float(dy), 5), int(own.sum())))
    return tuple(out)
