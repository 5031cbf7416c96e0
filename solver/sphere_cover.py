"""Spheres that cover a camera's body, for smooth distances between bodies."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from geometry.arrays import Floats, frozen
from geometry.camera import Body

_CELL_MM = 30.0
"""Edge of the cells a body is cut into: smaller cells hug it closer but cost more rows."""


@lru_cache(maxsize=64)
def sphere_cover(body: Body) -> tuple[Floats, Floats]:
    """Centres (m, 3) in the camera frame and radii (m,), mm, of spheres that contain the body.

    The box is cut into cells and the lens into slices; each is put into its circumscribed
    sphere, so the cover reaches at most half a cell's diagonal beyond the body.
    """
    counts = np.maximum(1, np.ceil(body.size_mm / _CELL_MM).astype(int))
    cell = body.size_mm / counts
    steps = [
        (np.arange(n) + 0.5) * c - s / 2.0
        for n, c, s in zip(counts, cell, body.size_mm, strict=True)
    ]
    grid = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    centres = [grid + body.centre_camera_mm]
    radii = [np.full(len(grid), float(np.linalg.norm(cell)) / 2.0)]
    if body.lens_diameter_mm > 0.0 and body.lens_length_mm > 0.0:
        slices = max(1, int(np.ceil(body.lens_length_mm / body.lens_diameter_mm)))
        step = body.lens_length_mm / slices
        z = body.front_z_mm + (np.arange(slices) + 0.5) * step
        centres.append(np.stack([np.zeros(slices), np.zeros(slices), z], axis=1))
        radii.append(np.full(slices, float(np.hypot(body.lens_diameter_mm, step)) / 2.0))
    return frozen(np.concatenate(centres)), frozen(np.concatenate(radii))
