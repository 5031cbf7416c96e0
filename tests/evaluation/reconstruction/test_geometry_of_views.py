"""The geometry that matching stands on, against the collinearity equations themselves."""

from __future__ import annotations

from dataclasses import replace

import cv2
import matching_scenes as scenes
import numpy as np
import pytest

from common.errors import InputError
from evaluation.reconstruction.between import gaps, guesses
from evaluation.reconstruction.depthmaps import DepthMap, bent, facing, relations
from evaluation.reconstruction.fusion import SHARED, boldness, fused, joined, measured_points
from evaluation.reconstruction.neighbours import on_surface
from evaluation.reconstruction.pairs import companions, partners, pixel_ratios, ray_angles_deg
from evaluation.reconstruction.reconstructing import ReconstructionOptions, reconstruct
from evaluation.reconstruction.views import View, memory_told
from evaluation.reconstruction.volume import Volume, common_volume


def projected(view: View, points: np.ndarray) -> np.ndarray:
    local = (points - view.pose.position_rig_mm) @ view.pose.rotation_rig_to_camera.T
    return (local / local[:, 2:]) @ view.matrix.T


def test_a_pixel_at_an_inverse_depth_is_seen_where_its_point_is() -> None:
    views = scenes.plane_views()
    matrices, shifts = relations(views[0], views[1:])
    rng = np.random.default_rng(3)
    pixel = np.column_stack([rng.uniform(0, 200, (50, 2)), np.ones(50)])
    rho = rng.uniform(1 / 500, 1 / 300, 50)
    rays = pixel @ np.linalg.inv(views[0].matrix).T / rho[:, None]
    points = rays @ views[0].pose.rotation_rig_to_camera + views[0].pose.position_rig_mm
    for view, matrix, shift in zip(views[1:], matrices, shifts, strict=True):
        seen = pixel @ matrix.T + rho[:, None] * shift
        # Rounding of numbers of a few hundred.
        assert seen / seen[:, 2:] == pytest.approx(projected(view, points), abs=1e-9)


def test_a_reduced_view_shows_points_where_its_pixels_are() -> None:
    view = scenes.plane_views()[0]
    small = view.reduced()
    points = np.random.default_rng(0).uniform(-20, 20, (20, 3))
    full, half = projected(view, points)[:, :2], projected(small, points)[:, :2]
    assert half == pytest.approx((full - 0.5) / 2.0, abs=1e-9)
    assert small.grey[3, 5] == pytest.approx(view.grey[6:8, 10:12].mean(), abs=1e-6)


def test_the_volume_is_where_the_axes_meet() -> None:
    volume = common_volume(scenes.plane_views())
    assert volume.centre_rig_mm == pytest.approx(np.zeros(3), abs=1e-9)
    # Half of the wider side, 240 px, at about 417 mm and 900 px.
    assert volume.radius_mm == pytest.approx(417 * 120 / 900, rel=0.02)


def test_parallel_cameras_have_no_common_volume() -> None:
    views = [scenes.plane_view(f"c{k}", scenes.looking_at_origin((0, -400, 0))) for k in range(2)]
    with pytest.raises(InputError, match="in parallel"):
        common_volume(views)


def test_partners_stand_at_the_angle_that_matches_best() -> None:
    angles = np.abs(np.subtract.outer([0.0, 6.0, 13.0, 30.0, 70.0], [0.0, 6.0, 13.0, 30.0, 70.0]))
    assert partners(angles, 0, 2, 40.0) == (2, 3)
    assert companions(angles, 0, 4, 40.0) == (1, 2, 3)
    assert partners(angles, 4, 2, 40.0) == (3,)
    assert partners(angles, 4, 2, 39.0) == ()
    assert companions(angles, 0, 4, 29.0) == (1, 2)


def test_rays_to_the_middle_make_the_angles() -> None:
    views = scenes.plane_views()
    angle = ray_angles_deg(views, Volume(np.zeros(3), 50.0))[0, 1]
    a, b = (v.pose.position_rig_mm for v in views[:2])
    assert np.cos(np.radians(angle)) == pytest.approx(a @ b / np.linalg.norm(a) / np.linalg.norm(b))


def test_cameras_of_other_pixels_are_not_matched() -> None:
    views = scenes.plane_views()
    far = replace(views[0], name="far", pose=scenes.looking_at_origin((20.0, -840.0, 0.0)))
    ratio = pixel_ratios([*views, far], Volume(np.zeros(3), 50.0))
    # All have one focal length: pixels are as large as the cameras are far.
    assert ratio[0, 4] == ratio[4, 0] == pytest.approx(np.hypot(20.0, 840.0) / 420.0)
    assert ratio[:4, :4].max() < 1.02
    alone = ReconstructionOptions(largest_ratio=1.5)
    with pytest.raises(InputError, match=r"degrees apart, with pixels at most 1\.5 times"):
        reconstruct([views[0], far], options=alone)


def test_what_is_seen_at_a_slant_is_left_out() -> None:
    map_ = exact_map(scenes.plane_views()[2])
    view, normal = map_.reference, scenes.TILTED / np.linalg.norm(scenes.TILTED)
    points = measured_points(map_).points_mm
    rays = view.pose.position_rig_mm - points
    slant = np.degrees(np.arccos(rays @ normal / np.linalg.norm(rays, axis=1)))
    limit = float(np.median(slant))
    assert np.array_equal(facing(map_, limit + 1e-9).ravel(), slant <= limit + 1e-9)


def exact_map(view: View, stride: int = 3) -> DepthMap:
    rho = scenes.true_inverse_depth(view)
    dy, dx = np.gradient(rho)
    grid = (slice(None, None, stride), slice(None, None, stride))
    slopes = np.stack([dx, dy], axis=-1)[grid]
    shape = rho[grid].shape
    return DepthMap(
        view, stride, rho[grid], slopes, np.full(shape, 1e-12), np.ones(shape, np.float32),
        np.full(shape, 2, np.int8),
    )  # fmt: skip


def test_points_of_an_exact_map_lie_on_the_plane_and_face_the_camera() -> None:
    view = scenes.plane_views()[2]
    points = measured_points(exact_map(view))
    normal = scenes.TILTED / np.linalg.norm(scenes.TILTED)
    assert np.abs(points.points_mm @ normal).max() < 1e-9
    # A plane's inverse depth is linear in the picture, so differences are exact too.
    assert points.normals == pytest.approx(np.broadcast_to(normal, points.normals.shape), abs=1e-9)


def test_the_density_of_fused_points_is_that_of_all_maps_together() -> None:
    maps = [exact_map(view) for view in scenes.plane_views()[:2]]
    points = joined([fused(maps, 0), fused(maps, 1)])
    middle = np.linalg.norm(points.points_mm, axis=1) < 20.0
    disc_mm2 = np.pi * 20.0**2
    # Cells of 1.4 mm: the rim cuts 90 of each grid's 640, a tenth of which may fall either way.
    assert points.per_mm2[middle].mean() == pytest.approx(middle.sum() / disc_mm2, rel=0.03)


def test_a_gap_is_filled_once_by_the_picture_that_shows_most_of_it() -> None:
    maps = [exact_map(view) for view in scenes.plane_views()[:2]]
    # The second camera's guesses count as if it stood nearer.
    places = [guesses(m, np.ones(m.inverse_depth_per_mm.shape, dtype=bool), 0.0)[0] for m in maps]
    places[1] = replace(places[1], per_mm2=places[1].per_mm2 * 9.0)
    points = np.concatenate([measured_points(m).points_mm for m in maps])
    hole = np.linalg.norm(points, axis=1) < 10.0
    take = gaps(places, points[~hole], 1.2)
    at = np.concatenate([p.points_mm[t] for p, t in zip(places, take, strict=True)])
    assert len(at) > 100 and np.linalg.norm(at, axis=1).max() < 10.0
    assert len(np.unique(np.floor(at / 1.2), axis=0)) == len(at)
    assert take[1].sum() > 5 * take[0].sum()


def test_stray_points_and_rims_go_and_the_surface_stays() -> None:
    rng = np.random.default_rng(2)
    flat = np.column_stack([rng.uniform(0, 30, (4000, 2)), rng.normal(0, 0.01, 4000)])
    stray = np.column_stack([rng.uniform(0, 30, (60, 2)), rng.uniform(0.3, 2.0, 60)])
    points = np.vstack([flat, stray])
    normals = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    keep = on_surface(points, normals, np.full(len(points), 0.01), 0.05)
    assert keep[:4000].mean() > 0.999
    assert not keep[4000:].any()


def test_too_little_memory_is_told_as_such_by_opencv_too() -> None:
    with pytest.raises(MemoryError), memory_told():
        cv2.resize(np.zeros((4, 4), np.uint8), (1 << 30, 1 << 30))
    with pytest.raises(cv2.error), memory_told():
        cv2.resize(np.zeros((4, 4), np.uint8), (0, 0))


def seen_edgewise() -> DepthMap:
    """A camera 88 degrees from the plane's normal whose patches lean 18 degrees towards it."""
    normal = scenes.TILTED / np.linalg.norm(scenes.TILTED)
    along = np.cross(normal, [0.0, 0.0, 1.0])
    turn = np.radians(88.0)
    place = 420.0 * (np.cos(turn) * normal + np.sin(turn) * along / np.linalg.norm(along))
    map_ = exact_map(scenes.plane_view("edge", scenes.looking_at_origin(place.tolist())), 1)
    known = map_.inverse_depth_per_mm > 0.0
    return replace(
        map_,
        inverse_depth_per_mm=np.where(known, map_.inverse_depth_per_mm, np.nan),
        slopes=map_.slopes * np.tan(np.radians(70.0)) / np.tan(turn),
        variance=np.full(known.shape, 1e-12),
    )


def test_a_camera_that_sees_a_surface_edgewise_does_not_pull_it() -> None:
    front = [exact_map(view) for view in scenes.plane_views()[:2]]
    front = [replace(m, variance=np.full(m.variance.shape, 1e-14)) for m in front]
    points = fused([*front, seen_edgewise()], 0).points_mm
    off = np.abs(points @ scenes.TILTED / np.linalg.norm(scenes.TILTED))
    assert len(points) > 100
    # Half a pixel of 0.47 mm is read off the leaning patches: 0.23 mm. Along their own normals they
    # have 0.1 / rho^2 um = 0.18 mm times cos 70 deg, 3.4 times the others' sigma: of three weights
    # theirs is 1 / 24, and a tenth of the points lie nearer or farther than that. By the cosine of
    # the point's own normal, 88 deg, they would have 0.006 mm and pull by 0.15 mm.
    assert np.percentile(off, 75.0) < 0.23 / 24.0
    assert off.max() < 0.23 / 4.0


def test_curvature_is_taken_out_of_a_map() -> None:
    view = scenes.plane_views()[0]
    flat = exact_map(view)
    rows, columns = np.indices(flat.inverse_depth_per_mm.shape) * float(flat.stride_px)
    bend = np.array([2e-9, -5e-10])
    middle = np.array([columns.mean(), rows.mean()])
    true = flat.inverse_depth_per_mm + 0.5 * (
        bend[0] * (columns - middle[0]) ** 2 + bend[1] * (rows - middle[1]) ** 2
    )
    slopes = flat.slopes + np.stack(
        [bend[0] * (columns - middle[0]), bend[1] * (rows - middle[1])], -1
    )
    # The mean of i^2 over -4..4 is 20 / 3: what a plane through such a patch lies off.
    fitted = replace(flat, inverse_depth_per_mm=true + bend.sum() * 10.0 / 3.0, slopes=slopes)
    off = bent(fitted, 4).inverse_depth_per_mm - true
    inner = (slice(14, -14), slice(14, -14))
    # Gaussian weights reach 4 x 3 cells: beyond, a quadric's slopes are linear and kept exactly.
    assert np.abs(off[inner]).max() < 1e-3 * bend.sum() * 10.0 / 3.0


def test_sigmas_grow_where_cameras_disagree_more_than_they_should() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(0.0, 30.0, (6000, 3)) * [1.0, 0.4, 0.4]
    apart = rng.normal(0.0, np.sqrt(1.0 - SHARED), len(points))
    apart[points[:, 0] >= 15.0] *= 3.0
    factor = boldness(points, apart)
    # A robust spread of 3,000 is known to 1.17 / sqrt(6,000) = 1.5 %; three times that.
    assert factor[points[:, 0] >= 15.5] == pytest.approx(3.0, rel=0.05)
    assert factor[points[:, 0] < 14.5] == pytest.approx(1.0, abs=0.05)
    assert np.array_equal(boldness(points[:50], apart[:50]), np.ones(50))
