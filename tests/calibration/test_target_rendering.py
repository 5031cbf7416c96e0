"""Rendered targets against pictures made of points only, with no soft edges at all."""

from __future__ import annotations

import numpy as np
import pytest
import target_scenes as scenes
from held_patterns import placed_carrier
from scipy.ndimage import gaussian_filter

from calibration.targets.kinds import CarrierKind
from calibration.targets.rendering import render
from geometry.arrays import Floats
from geometry.camera import Camera

POINTS = 16
"""Samples of the brute-force picture per pixel, each way."""


def from_points(kind: CarrierKind, view: Camera, turn: Floats, shift: Floats) -> Floats:
    """Each sample asked for its colour alone; boxes of a thousandth of a millimetre are points."""
    width, height = view.image_size_px
    x, y = ((np.arange(n * POINTS) + 0.5) / POINTS - 0.5 for n in (width, height))
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    image = np.full(len(pixels), 150.0)
    for item in placed_carrier(kind, turn, shift):
        plane = item.plane(view, pixels)
        left, top, right, bottom = item.pattern.extent_mm
        on = (plane[:, 0] > left) & (plane[:, 0] < right)
        on &= (plane[:, 1] > top) & (plane[:, 1] < bottom)
        white = item.pattern.white_share(plane[on, 0], plane[on, 1], (1e-3, 1e-3)) > 0.5
        image[on] = np.where(white, 220.0, 30.0)
    fine = gaussian_filter(image.reshape(height * POINTS, width * POINTS), 0.7 * POINTS)
    return np.asarray(fine.reshape(height, POINTS, width, POINTS).mean(axis=(1, 3)))


@pytest.mark.parametrize("kind", [scenes.PLATE, scenes.markers(1), scenes.rings(1)])
def test_a_rendered_picture_is_the_one_that_points_make(kind: CarrierKind) -> None:
    view = scenes.camera((36, 32), 90.0 if kind is scenes.PLATE else 220.0, -0.1)
    turn = scenes.rotation(35.0, 10.0, 20.0)
    shift = np.array([0.0, 0.0, 300.0]) - turn @ scenes.middle_mm(kind)
    own = render(view, placed_carrier(kind, turn, shift), 0.7, 30.0, 220.0, 150.0)
    points = from_points(kind, view, turn, shift)
    # Points have stairs: an edge is off by up to 1/32 pixel, 190 grey levels wide over 2 pixels;
    # the sum over the picture shows any shift or softness that is systematic.
    inner = (slice(4, -4), slice(4, -4))
    assert np.abs(own - points)[inner].max() < 190.0 / POINTS / 2.0
    assert abs(float((own - points)[inner].mean())) < 0.05
