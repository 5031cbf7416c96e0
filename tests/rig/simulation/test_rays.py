"""The ray of every pixel is the inverse of OpenCV's projection."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from simulated_rigs import NONE, STRONG, lens

from rig.simulation.raytable import RayTables, ray_table, rays_beside

TOLERANCE_PX = 0.01


def projected(table_rays: np.ndarray, camera_matrix: np.ndarray, distortion: np.ndarray):  # noqa: ANN201
    points = np.concatenate([table_rays, np.ones((len(table_rays), 1))], axis=1) * 900.0
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera_matrix, distortion)
    return pixels.reshape(-1, 2)


@pytest.mark.parametrize(
    ("width_px", "distortion"),
    [
        (600, NONE),
        (600, (-0.12, 0.05, 0.0, 0.0, 0.0)),
        pytest.param(2000, STRONG, marks=pytest.mark.slow),
    ],
)
def test_every_pixels_ray_projects_back_to_it(width_px: int, distortion: tuple[float, ...]) -> None:
    middle = (0.507 * width_px, 0.371 * width_px)
    camera = lens(width_px, 40.0, distortion, principal_point_px=middle)
    table = ray_table(camera)
    width, height = camera.image_size_px
    assert table.shape == (height, width, 2)
    pixels = projected(
        table.reshape(-1, 2).astype(np.float64), camera.camera_matrix, camera.distortion
    )
    y, x = np.mgrid[:height, :width]
    error = np.linalg.norm(pixels - np.stack([x.ravel(), y.ravel()], axis=1), axis=1)
    # Single precision of x/z up to 0.4 at 2750 px of focal length is 1e-4 px.
    assert error.max() < 1e-3 < TOLERANCE_PX
    if any(distortion):
        straight = ray_table(lens(width_px, 40.0, NONE, principal_point_px=middle))
        moved = np.abs(straight - table).max() * camera.focal_length_px
        assert moved > 2.0, "the distortion must have been felt"


@pytest.mark.slow
def test_rays_within_a_pixel_agree_too() -> None:
    camera = lens(2000, 40.0, STRONG)
    table = ray_table(camera)
    rng = np.random.default_rng(3)
    rows, columns = rng.integers(0, 1500, 500), rng.integers(0, 2000, 500)
    offsets = np.array([[-0.49, -0.49], [0.49, 0.2], [0.0, 0.45]], dtype=np.float32)
    rays = rays_beside(table, rows, columns, offsets).astype(np.float64)
    wanted = np.stack([columns, rows], axis=1)[:, None] + offsets
    pixels = projected(rays.reshape(-1, 2), camera.camera_matrix, camera.distortion)
    assert np.abs(pixels - wanted.reshape(-1, 2)).max() < TOLERANCE_PX


def test_cameras_of_one_kind_share_a_table() -> None:
    tables = RayTables()
    assert tables.of(lens(80)) is tables.of(lens(80))
    assert tables.of(lens(80)) is not tables.of(lens(80, distortion=STRONG))
