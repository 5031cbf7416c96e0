"""Range images: uneven points, holes, strays, layers."""

from __future__ import annotations

import numpy as np

from evaluation.recognition.rangeimage import FACE_GRID, foremost, range_image
from geometry.arrays import Floats


def slope(count: int, seed: int) -> Floats:
    """Points of a plane, three times as dense on one side."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-70.0, 70.0, count)
    x = np.where((x < 0.0) & (rng.random(count) < 0.5), -x, x)
    z = rng.uniform(-75.0, 85.0, count)
    return np.stack([x, -(3.0 + 0.5 * x - 0.2 * z), z], axis=1)


def expected() -> Floats:
    x, z = np.meshgrid(FACE_GRID.x_mm, FACE_GRID.z_mm)
    return 3.0 + 0.5 * x - 0.2 * z


def test_a_plane_stays_a_plane_however_uneven_its_points_are() -> None:
    image = range_image(slope(150_000, 0), FACE_GRID)
    error = np.abs(image - expected())
    assert np.isfinite(error).all()
    # Slopes are held by a twentieth: that share of the slope, half a millimetre, and how far the
    # middle of some seven points' weight is off.
    assert np.median(error) < 0.01
    assert error.max() < 0.2


def test_holes_stay_holes_and_strays_go() -> None:
    points = slope(150_000, 1)
    hole = np.hypot(points[:, 0] - 20.0, points[:, 2] - 10.0) < 8.0
    stray = np.array([[-20.0, -60.0, -10.0], [0.0, -45.0, 40.0]])
    given = np.concatenate([points[~hole], stray])
    image = range_image(given[foremost(given, FACE_GRID)], FACE_GRID)
    x, z = np.meshgrid(FACE_GRID.x_mm, FACE_GRID.z_mm)
    away = np.hypot(x - 20.0, z - 10.0)
    # Sums reach two places and a half from the rim.
    assert np.isnan(image[away < 5.0]).all()
    assert np.isfinite(image[away > 8.5]).mean() > 0.999
    near = np.hypot(x + 20.0, z + 10.0) < 5.0
    rest = (image - expected())[near]
    assert np.nanmax(np.abs(rest)) < 0.5


def test_the_foremost_of_two_layers_counts() -> None:
    front, behind = slope(150_000, 2), slope(150_000, 3)
    behind[:, 1] += 25.0
    both = np.concatenate([front, behind])
    image = range_image(both[foremost(both, FACE_GRID)], FACE_GRID)
    assert np.nanmedian(np.abs(image - expected())) < 0.01


def test_nothing_near_is_an_image_of_holes() -> None:
    far = np.full((5, 3), 500.0)
    assert np.isnan(range_image(far, FACE_GRID)).all()
    assert not foremost(far, FACE_GRID).any()


def test_sparse_points_lose_no_steep_flank() -> None:
    x, z = (g.ravel() for g in np.meshgrid(np.arange(-62, 62, 1.7), np.arange(-68, 78, 1.7)))
    roof = np.stack([x, np.abs(x), z], axis=1)
    image = range_image(roof[foremost(roof, FACE_GRID)], FACE_GRID)
    assert np.isfinite(image[:, 1:-1]).mean() > 0.99
    flank = np.abs(FACE_GRID.x_mm) > 5.0
    # Slopes are held by a twentieth, and points lie up to 0.85 mm to one side.
    assert np.nanmedian(np.abs(image + np.abs(FACE_GRID.x_mm))[:, flank]) < 0.05
