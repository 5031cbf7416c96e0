"""Starts: from nothing, from unknown targets, from a wand, from a design that was set up badly."""

from __future__ import annotations

from dataclasses import replace

import calibrations
import numpy as np
import pytest
from synthetic_scenes import Scene, face_rig, plate, plate_places, stand, turned

from calibration.adjustment import Calibration, CalibrationOptions, calibrate
from calibration.adjustment.initialisation.resection import RigidTransform
from calibration.observations import Carrier, Distance, TargetSet

SCENE = calibrations.small_scene()
QUICK = CalibrationOptions(cross_validate=False)


def same_shape(found: Calibration, scene: Scene, tolerance_mm: float) -> None:
    """Distances between camera centres are the truth's: free of any frame."""
    ours = np.stack([c.pose.position_rig_mm for c in found.cameras])
    theirs = np.stack([c.pose.position_rig_mm for c in scene.cameras])
    for a, b in ((ours, theirs),):
        away = np.linalg.norm(a[:, None] - a[None], axis=2)
        expected = np.linalg.norm(b[:, None] - b[None], axis=2)
        np.testing.assert_allclose(away, expected, atol=tolerance_mm)


def test_from_nothing_it_ends_where_it_ends_from_the_truth() -> None:
    observations = SCENE.observe(0.1, 21)
    found = calibrate(observations, QUICK)
    reference = calibrations.small_reference()
    assert found.quality.converged
    # The one minimum, reached from two sides; a thousandth of chi-square is nothing.
    assert found.quality.chi2 == pytest.approx(reference.quality.chi2, rel=1e-3)
    same_shape(found, SCENE, 0.5)


def test_from_nothing_the_frame_stands_upright() -> None:
    found = calibrate(SCENE.observe(0.1, 21), QUICK)
    forward = np.mean([c.pose.rotation_rig_to_camera[2] for c in found.cameras], axis=0)
    assert forward[1] > 0.5
    assert abs(forward[0]) < 0.2


def test_plates_alone_are_enough() -> None:
    carrier, points = plate()
    places = (plate_places(8, 3),)
    scene = Scene(face_rig(3), TargetSet("plate", (carrier,)), points, places)
    found = calibrate(scene.observe(0.05, 2), QUICK)
    assert found.quality.rms_px == pytest.approx(0.05, rel=0.1)
    same_shape(found, scene, 2.0)


def test_unknown_targets_need_focal_lengths_and_a_scale_only() -> None:
    carrier, points = stand(50, 4)
    unknown = Carrier(
        "stand", carrier.ids, np.full((50, 3), np.nan), np.full((50, 3), np.inf), fixed=True
    )
    length = float(np.linalg.norm(points[0] - points[1]))
    distances = (Distance("ring1", "ring2", length, 0.01),)
    places = ((RigidTransform(np.eye(3), np.zeros(3)),),)
    scene = Scene(face_rig(4), TargetSet("rings", (unknown,), distances), points, places)
    # A data sheet's values: f to 1 %, centre and distortion unknown.
    interiors = {
        c.name: replace(
            c.interior,
            focal_length_px=c.interior.focal_length_px * 1.01,
            principal_point_px=np.array([2999.5, 1999.5]),
            distortion=np.zeros(5),
        )
        for c in scene.cameras
    }
    found = calibrate(scene.observe(0.05, 3), replace(QUICK, interiors=interiors))
    assert found.quality.rms_px < 0.06
    assert found.quality.scale == "distances"
    got, sigma = found.length_mm("ring3", "ring40")
    expected = float(np.linalg.norm(points[2] - points[39]))
    assert abs(got - expected) < 4.0 * sigma


def wand_scene(frames: int) -> Scene:
    """A bar of two balls waved through the volume."""
    rng = np.random.default_rng(5)
    nominal = np.array([[0.0, 0.0, 0.0], [200.0, 0.0, 0.0]])
    bar = Carrier("wand", ("left", "right"), nominal, np.full((2, 3), 0.005))
    places = []
    for _ in range(frames):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        middle = rng.uniform(-60.0, 60.0, 3)
        places.append(RigidTransform(turn, middle - turn @ [100.0, 0.0, 0.0]))
    # A wand is seen from all sides.
    return Scene(
        face_rig(3), TargetSet("wand", (bar,)), nominal, (tuple(places),), widest_deg=180.0
    )


def test_a_wand_is_enough_when_the_lenses_are_known() -> None:
    scene = wand_scene(40)
    interiors = {c.name: c.interior for c in scene.cameras}
    found = calibrate(scene.observe(0.05, 4), replace(QUICK, interiors=interiors))
    assert found.quality.rms_px < 0.06
    same_shape(found, scene, 3.0)


@pytest.mark.parametrize("size_mm", [3.0, 60.0])
def test_a_design_set_up_badly_is_a_start_all_the_same(size_mm: float) -> None:
    rng = np.random.default_rng(6)
    designed = tuple(
        turned(c, size_mm * rng.normal(size=3), size_mm / 1000.0 * rng.normal(size=3))
        for c in SCENE.cameras
    )
    found = calibrate(SCENE.observe(0.1, 21), replace(QUICK, start=designed))
    expected = calibrations.small_reference().quality.chi2
    assert found.quality.chi2 == pytest.approx(expected, rel=1e-3)
    # The frame is the design's: the cameras as a whole neither moved nor turned against it.
    ours = np.mean([c.pose.position_rig_mm for c in found.cameras], axis=0)
    theirs = np.mean([c.pose.position_rig_mm for c in designed], axis=0)
    assert np.linalg.norm(ours - theirs) < size_mm


def test_two_cameras_and_a_fixed_plate_with_known_coordinates() -> None:
    carrier, points = plate(sigma_mm=0.0)
    still = replace(carrier, fixed=True)
    other, more = plate(6, 5, 25.0, seed=9)
    second = Carrier("other", tuple(f"o{k}" for k in range(30)), other.nominal_mm, other.sigma_mm)
    scene = Scene(
        face_rig(2),
        TargetSet("both", (still, second)),
        np.concatenate([points, more]),
        (plate_places(1, 1), plate_places(6, 2)),
    )
    found = calibrate(scene.observe(0.05, 5), QUICK)
    assert found.quality.rms_px < 0.06
    np.testing.assert_array_equal(found.target_mm[: len(points)], carrier.nominal_mm)
