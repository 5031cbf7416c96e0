"""Patches on pictures whose truth is known to the last bit."""

from __future__ import annotations

import matching_scenes as scenes
import numpy as np
import pytest

from evaluation.reconstruction.between import filled, gaps, guesses
from evaluation.reconstruction.depthmaps import Matching, refined
from evaluation.reconstruction.fusion import measured_points

pytest.importorskip("numba")
pytestmark = pytest.mark.slow  # the kernel is compiled first, which takes longer than the tests


def matched(noise: float, off_px: float):  # noqa: ANN201
    views = scenes.plane_views(noise)
    truth = scenes.true_inverse_depth(views[0])[::4, ::4]
    # One pixel of the widest pair is 1 / (focal length x base).
    start = truth + off_px / (scenes.FOCAL_PX * 115.0)
    slopes = np.zeros((*truth.shape, 2))
    found = refined(views[0], views[1:], start, slopes, 4, Matching(half_width_samples=4, steps=8))
    return truth, found


def test_a_slanted_plane_is_found_exactly_from_a_pixel_away() -> None:
    truth, found = matched(0.0, 1.0)
    inside = np.isfinite(found.inverse_depth_per_mm)
    assert inside.mean() > 0.6
    error_mm = (1 / found.inverse_depth_per_mm - 1 / truth)[inside]
    # Bilinear samples of a wave of 4 mm (9 px) are off by up to 1/8 (2 pi / 9)^2 = 6 % of its
    # amplitude midway between pixels; over a patch the phases average. 0.03 px of 0.45 mm
    # x 420 / 115 (height to base) are 0.05 mm.
    assert np.median(np.abs(error_mm)) < 0.02
    assert np.abs(error_mm.mean()) < 0.005
    points = measured_points(found)
    normal = scenes.TILTED / np.linalg.norm(scenes.TILTED)
    lean = np.degrees(np.arccos(np.clip(points.normals @ normal, -1, 1)))
    assert np.median(lean) < 1.0


def test_the_stated_variance_is_that_of_the_scatter() -> None:
    _, found = matched(0.01, 0.3)
    _, clean = matched(0.0, 0.3)
    inside = np.isfinite(found.inverse_depth_per_mm) & np.isfinite(clean.inverse_depth_per_mm)
    # Against the same pictures without noise: what interpolation adds is the same in both.
    z = ((found.inverse_depth_per_mm - clean.inverse_depth_per_mm) / np.sqrt(found.variance))[
        inside
    ]
    spread = 1.4826 * np.median(np.abs(z))
    # 1,500 patches that overlap: the spread itself is known to about 4 %. The gradient is taken
    # from noisy pixels too, which is not in the covariance: a tenth at this noise.
    assert 0.75 < spread < 1.25


def test_a_view_of_something_else_is_left_out() -> None:
    views = scenes.plane_views()
    views[2] = scenes.plane_view("other", views[2].pose, normal=np.array([0.9, -0.4, 0.2]))
    truth = scenes.true_inverse_depth(views[0])[::6, ::6]
    found = refined(views[0], views[1:], truth, np.zeros((*truth.shape, 2)), 6, Matching())
    inside = np.isfinite(found.inverse_depth_per_mm)
    assert np.median(found.views[inside]) == 2
    assert np.median(np.abs(1 / found.inverse_depth_per_mm - 1 / truth)[inside]) < 0.03


def test_gaps_are_filled_between_patches_and_a_step_beyond_their_rim() -> None:
    views = scenes.plane_views()
    truth = scenes.true_inverse_depth(views[0])
    start = truth[::4, ::4].copy()
    start[:, 40:] = np.nan
    slopes = np.zeros((*start.shape, 2))
    how = Matching(half_width_samples=4, steps=8)
    coarse = refined(views[0], views[1:], start, slopes, 4, how)
    known = np.isfinite(coarse.inverse_depth_per_mm)
    thin = known.copy()
    thin[:, :20] = False
    points = measured_points(coarse).points_mm
    place, plane = guesses(coarse, thin, 1.1)
    # A cell is 1.9 mm wide: its middle lies 1.3 mm from its corners, the middles of its sides 0.9.
    (take,) = gaps([place], points, 1.1)
    pixels = place.pixels[take]
    widest = scenes.FOCAL_PX * 115.0
    made = filled(coarse, views[1:], pixels, plane[take], how, widest, steepest_deg=70.0)
    columns, rows = made.pixels.T
    middle = (columns % 4 == 2) & (rows % 4 == 2)
    beyond = (columns % 4 == 0) & (rows % 4 == 0)
    assert (middle | beyond).all()
    assert columns[beyond].max() == 160
    assert not known[rows[beyond] // 4, columns[beyond] // 4].any()
    assert thin[rows[middle] // 4, columns[middle] // 4].all()
    assert middle.sum() > 0.95 * thin.sum()
    # As for the coarse patches themselves, see above.
    rho = 1 / truth[rows, columns]
    local = (made.points_mm - views[0].pose.position_rig_mm) @ views[
        0
    ].pose.rotation_rig_to_camera.T
    assert np.median(np.abs(local[:, 2] - rho)) < 0.02
    # The first camera looks at the plane at 17 degrees, its rays lie within 10 of its axis.
    steep = filled(coarse, views[1:], pixels, plane[take], how, widest, steepest_deg=5.0)
    assert len(steep.points_mm) == 0
