"""The field of a camera in cells: which of them pictures show targets in."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats, Ints

GRID = 5
"""Cells along each side of the field."""


def cells_of(pixels: Floats, size_px: tuple[int, int]) -> Ints:
    """The cells (C, 2), as column and row, that ``pixels`` (N, 2) lie in.

    Pixel centres are at integers; what lies outside counts to the nearest cell.
    """
    cells = np.clip(((pixels + 0.5) / np.array(size_px) * GRID).astype(int), 0, GRID - 1)
    return np.unique(cells, axis=0)
