"""Observations that cannot be calibrated: one line each that says what to do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import calibrations
import numpy as np
import pytest
from synthetic_scenes import Scene, face_rig, plate, plate_places, stand

from calibration.adjustment import CalibrationOptions, InteriorModel, ReferencePoses, calibrate
from calibration.adjustment.initialisation.resection import RigidTransform
from calibration.adjustment.options import FREE
from calibration.observations import Carrier, Distance, Observations, TargetSet
from common.errors import InputError
from geometry.frames import Pose

SCENE = calibrations.small_scene()
GOOD = SCENE.observe(0.1, 1)


def rows(condition: np.ndarray) -> Observations:
    return GOOD.subset(np.flatnonzero(condition))


def one_camera() -> Observations:
    return Scene(face_rig(5)[:1], SCENE.targets, SCENE.true_mm, SCENE.places).observe(0.1, 1)


def no_targets() -> Observations:
    return rows(GOOD.camera < 0)


def one_blind_camera() -> Observations:
    return rows((GOOD.camera != 2) | (GOOD.target == 3))


def mirrored_camera() -> Observations:
    pixel = GOOD.pixel.copy()
    own = GOOD.camera == 3
    pixel[own, 0] = GOOD.image_size_px[3, 0] - 1.0 - pixel[own, 0]
    return replace(GOOD, pixel=pixel)


def wrong_board() -> Observations:
    """The plate's corners numbered the other way round in the target set."""
    rings, board = SCENE.targets.carriers
    turned = Carrier(
        board.name,
        board.ids,
        np.random.default_rng(1).permutation(board.nominal_mm),
        board.sigma_mm,
    )
    targets = TargetSet("wrong", (rings, turned), SCENE.targets.distances)
    return replace(GOOD, targets=targets)


def coordinates_in_metres() -> Observations:
    board = SCENE.targets.carriers[1]
    small = Carrier(board.name, board.ids, board.nominal_mm / 1000.0, board.sigma_mm / 1000.0)
    plate_only = GOOD.subset(np.flatnonzero(SCENE.targets.carrier_of[GOOD.target] == 1))
    target = plate_only.target - len(SCENE.targets.carriers[0].ids)
    return replace(plate_only, targets=TargetSet("m", (small,)), target=target)


def a_length_in_inches() -> Observations:
    first, *others = SCENE.targets.distances
    wrong = replace(first, length_mm=first.length_mm / 25.4)
    targets = replace(SCENE.targets, distances=(wrong, *others))
    return replace(GOOD, targets=targets)


def a_crop() -> Observations:
    return replace(GOOD, image_size_px=GOOD.image_size_px // 2)


def frontal_plates(step_mm: float = 9.0) -> Scene:
    """A plate that is never tilted, always at one distance, before two parallel cameras."""
    carrier, points = plate(sigma_mm=0.0)
    cameras = tuple(
        replace(c, pose=Pose.looking_at(np.array([x, -1000.0, 0.0]), np.array([x, 0.0, 0.0])))
        for c, x in zip(face_rig(2), (-20.0, 20.0), strict=True)
    )
    turn = cameras[0].pose.rotation_rig_to_camera.T
    places = tuple(
        RigidTransform(turn, dx * turn[:, 0] - 2.0 * dx * turn[:, 1])
        for dx in (-step_mm, 0.0, step_mm)
    )
    return Scene(cameras, TargetSet("p", (carrier,)), points, (places,))


def nothing_in_common() -> Observations:
    carrier, points = plate()
    scene = Scene(face_rig(7)[3:5], TargetSet("p", (carrier,)), points, (plate_places(8, 3),))
    seen = scene.observe(0.1, 2)
    return seen.subset(np.flatnonzero(seen.frame % 2 == seen.camera))


def no_size() -> Observations:
    carrier, points = stand(40)
    places = ((RigidTransform(np.eye(3), np.zeros(3)),),)
    return Scene(face_rig(3), TargetSet("r", (carrier,)), points, places).observe(0.1, 1)


CASES: list[tuple[Callable[[], Observations], str, str]] = [
    (one_camera, "input/calibration-one-camera", "1 camera only"),
    (no_targets, "input/calibration-no-targets", "no targets"),
    (one_blind_camera, "input/calibration-few-targets", "'cam3' sees"),
    (mirrored_camera, "input/calibration-mirrored", "'cam4' sees the targets mirrored"),
    (wrong_board, "input/calibration-no-fit", "do not fit"),
    (a_length_in_inches, "input/calibration-units", "inches"),
    (a_crop, "input/calibration-pixel-outside", "outside its"),
    (nothing_in_common, "input/calibration-not-joined", "joined"),
    (no_size, "input/calibration-scale", "size"),
]


@pytest.mark.parametrize(("make", "code", "words"), CASES, ids=lambda v: getattr(v, "__name__", ""))
def test_one_line_says_what_to_do(make: Callable[[], Observations], code: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        calibrate(make())
    assert caught.value.code == code
    assert words in caught.value.problem
    assert caught.value.remedy
    assert "\n" not in str(caught.value)


def test_coordinates_in_metres_are_noticed_beside_a_start() -> None:
    with pytest.raises(InputError) as caught:
        calibrate(coordinates_in_metres(), CalibrationOptions(start=SCENE.cameras))
    assert caught.value.code == "input/calibration-units"


def test_plates_never_tilted_do_not_determine_a_focal_length() -> None:
    with pytest.raises(InputError) as caught:
        calibrate(frontal_plates().observe(0.1, 2))
    assert caught.value.detail in (
        "calibration-degenerate",
        "calibration-interior",
        "calibration-undetermined",
    )


def test_where_alike_captures_are_the_reason_they_are_named() -> None:
    scene = frontal_plates(0.0)
    start = CalibrationOptions(start=scene.cameras, model=InteriorModel(f=FREE))
    with pytest.raises(InputError) as caught:
        calibrate(scene.observe(0.1, 2), start)
    assert "3 captures show the targets in 1 place only" in caught.value.problem


def test_a_start_with_other_names_is_refused() -> None:
    other = tuple(replace(c, name=f"x{c.name}") for c in SCENE.cameras)
    with pytest.raises(InputError, match="name the cameras alike"):
        calibrate(GOOD, CalibrationOptions(start=other))


def test_models_and_reference_poses_check_themselves() -> None:
    with pytest.raises(InputError, match="sigma"):
        InteriorModel(f=-1.0)
    with pytest.raises(InputError, match="sigma"):
        InteriorModel(k1=float("nan"))
    with pytest.raises(InputError, match="positive"):
        ReferencePoses(0.0, 1.0)


def test_a_distance_that_contradicts_the_plate_is_warned_of() -> None:
    first, *others = SCENE.targets.distances
    wrong = Distance(first.first, first.second, first.length_mm * 1.002, first.sigma_mm)
    spoilt = replace(GOOD, targets=replace(SCENE.targets, distances=(wrong, *others)))
    found = calibrate(spoilt, CalibrationOptions(start=SCENE.cameras, cross_validate=False))
    warning = next(w for w in found.quality.warnings if "Measured distances disagree" in w)
    assert f"{first.first}-{first.second}" in warning
    # The distance gives way, not the images.
    assert found.quality.rejected == 0
