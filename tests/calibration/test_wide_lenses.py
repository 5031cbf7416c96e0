"""Plates through wide lenses: the gates know that a lens bends a plane."""

from __future__ import annotations

import numpy as np
import pytest
from target_scenes import errors, shot
from wide_pairs import seen_by_two

from calibration.adjustment import CalibrationOptions, calibrate
from calibration.detection.finding import find_targets
from calibration.targets.kinds import CharucoPlate, TargetPlan
from geometry.camera import Body, Camera

BODY = Body(np.full(3, 50.0), np.zeros(3))


def wide(focal_px: float, terms: list[float]) -> Camera:
    """A camera of 1000 x 800 px; 400 px of focal length see 103 degrees across."""
    pitch = 0.005
    focal_mm = focal_px * pitch
    return Camera(
        "wide", (1000, 800), pitch, focal_mm, 8.0, 0.01, 10.0, BODY, distortion=np.array(terms)
    )


@pytest.mark.parametrize("terms", [[-0.25, 0.06, 0.0, 0.0, -0.005], [0.0, 0.0, 0.0, 0.0, 0.0]])
@pytest.mark.parametrize("turn_deg", [pytest.param(0.0, marks=pytest.mark.slow), 25.0])
def test_corners_of_a_plate_that_fills_a_wide_picture_are_kept(
    terms: list[float], turn_deg: float
) -> None:
    plate = CharucoPlate("plate", 10, 8, 20.0, 15.0, "DICT_5X5_100")
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    image, truth = shot(plate, wide(400.0, terms), turn, 95.0 + turn_deg)
    found = find_targets(image, TargetPlan("set", (plate,)))
    inside = [p for p in truth.values() if (p > 25).all() and (p < np.array([975, 775])).all()]
    assert len(inside) >= 50
    assert len(found) >= 0.97 * len(inside), [str(r) for r in found.rejections][:8]
    # Curved edges cost the saddle's straight ones a little.
    assert np.sqrt(np.mean(errors(found, truth) ** 2)) < 0.05


def test_the_few_corners_of_a_small_plate_near_the_edge_are_kept() -> None:
    plate = CharucoPlate("plate", 4, 5, 20.0, 15.0, "DICT_4X4_50")
    view = wide(500.0, [-0.28, 0.07, 0.0, 0.0, -0.006])
    image, _ = shot(plate, view, np.eye(3), 110.0, shift_mm=(-60.0, 35.0))
    found = find_targets(image, TargetPlan("set", (plate,)))
    assert found.ids == plate.ids, [str(r) for r in found.rejections]


def test_a_corner_out_of_its_place_is_still_thrown_out() -> None:
    plate = CharucoPlate("plate", 10, 8, 20.0, 15.0, "DICT_5X5_100")
    view = wide(400.0, [-0.25, 0.06, 0.0, 0.0, -0.005])
    image, truth = shot(plate, view, np.eye(3), 95.0)
    middle = truth[plate.ids[31]]
    x, y = (int(v) for v in np.rint(middle))
    patch = image[y - 14 : y + 15, x - 14 : x + 15].copy()
    image[y - 14 : y + 15, x - 11 : x + 18] = patch
    found = find_targets(image, TargetPlan("set", (plate,)))
    assert plate.ids[31] not in found.ids


@pytest.mark.slow
@pytest.mark.parametrize("legacy", [True, False])
def test_a_large_plate_of_the_other_pattern_is_explained(legacy: bool) -> None:
    made = CharucoPlate("plate", 19, 18, 10.0, 7.5, "DICT_5X5_250", legacy=not legacy)
    image, _ = shot(made, wide(1500.0, [0.0] * 5), np.eye(3), 360.0)
    told = CharucoPlate("plate", 19, 18, 10.0, 7.5, "DICT_5X5_250", legacy=legacy)
    found = find_targets(image, TargetPlan("set", (told,)))
    assert [f.code for f in found.findings] == ["legacy"]


def test_opencv_s_own_spelling_of_a_dictionary_is_known() -> None:
    from calibration.detection import opencv

    assert opencv.dictionary_size("DICT_APRILTAG_36h10") == 2320


@pytest.mark.parametrize("half_deg", [47.0, 60.0])
def test_a_fisheye_of_up_to_120_degrees_is_calibrated_from_nothing(half_deg: float) -> None:
    done = calibrate(seen_by_two(half_deg), CalibrationOptions(cross_validate=False))
    left, right = (camera.pose.position_rig_mm for camera in done.cameras)
    # A tenth of a per cent is what is asked of lengths.
    assert np.linalg.norm(right - left) == pytest.approx(120.0, rel=1e-3)
