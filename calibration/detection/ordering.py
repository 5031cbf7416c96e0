"""Which corner of a board without ids is its first: orders of its points that a picture allows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from calibration.detection.planes import homographies, mapped
from geometry.arrays import Floats, Ints

_AS_GOOD = 2.0


def orders(rows: int, columns: int) -> Iterator[Ints]:
    """All ways to number a grid of points (rows * columns,) that keep its shape."""
    grid = np.arange(rows * columns).reshape(rows, columns)
    for turned in (grid, grid.T) if rows == columns else (grid,):
        for flipped in (turned, turned[::-1], turned[:, ::-1], turned[::-1, ::-1]):
            yield flipped.ravel()


def fitting_orders(plane: Floats, pixels: Floats, rows: int, columns: int) -> list[Ints]:
    """Orders in which points (n, 2) of a plane appear at pixels (n, 2) seen from in front.

    The plane's axes turn as the picture's do; the orders that a homography fits as well as the best
    are all returned.
    """
    found: list[tuple[float, Ints]] = []
    for order in orders(rows, columns):
        matrix = homographies(plane[None], pixels[order][None])
        if not np.isfinite(matrix).all():
            continue
        guess, slope = mapped(np.repeat(matrix, len(plane), axis=0), plane)
        if np.median(np.linalg.det(slope)) > 0.0:
            away = np.linalg.norm(guess - pixels[order], axis=1)
            found.append((float(np.median(away)), order))
    best = min((away for away, _ in found), default=0.0)
    return [order for away, order in found if away <= _AS_GOOD * best + 1.0]


def local_axes(plane: Floats, pixels: Floats, step: float) -> Floats:
    """What one ``step`` along each axis of the plane is in pixels, at each of n points (n, 2, 2).

    From the homography of each point's nearest others.
    """
    return mapped(local_homographies(plane, pixels), plane)[1] * step


def local_homographies(plane: Floats, pixels: Floats, count: int = 13) -> Floats:
    """Homographies (n, 3, 3) of each point's neighbourhood, itself included."""
    away = np.linalg.norm(plane[:, None] - plane[None], axis=2)
    nearest = np.argsort(away, axis=1, kind="stable")[:, : min(count, len(plane))]
    return homographies(plane[nearest], pixels[nearest])


def turn_deg(plane: Floats, pixels: Floats) -> float:
    """How far the plane's x axis is turned in the picture, 0 to 180."""
    step = local_axes(plane, pixels, 1.0)[:, :, 0].sum(axis=0)
    return float(abs(np.degrees(np.arctan2(step[1], step[0]))))
