"""What several cameras have in common is said once, of them, and by nothing that cancels."""

from __future__ import annotations

from dataclasses import replace

import calibrations
import numpy as np
import pytest
from synthetic_scenes import Scene

from calibration.check import CheckResult, Kind, Light, check
from calibration.observations import Observations

SCENE = calibrations.check_scene()
NAMES = tuple(c.name for c in SCENE.cameras)
SHIFTS = [
    ((1, 2, 3, 4), (1.5, 0.7)),
    pytest.param((0, 1, 2, 3), (1.0, 0.0), marks=pytest.mark.slow),
    pytest.param((0, 1, 2, 4), (-8.0, 3.0), marks=pytest.mark.slow),
]


def checked(observations: Observations) -> CheckResult:
    return check(calibrations.small_reference(), observations)


def shifted(seen: Observations, which: tuple[int, ...], by: tuple[float, float]) -> Observations:
    """Some cameras' pictures cut out elsewhere, without what leaves them."""
    pixel = seen.pixel + np.isin(seen.camera, which)[:, None] * np.array(by)
    size = seen.image_size_px[seen.camera]
    inside = ((pixel >= 0.0) & (pixel <= size - 1.0)).all(axis=1)
    changed = replace(seen, pixel=np.clip(pixel, 0.0, size - 1.0))
    return changed.subset(np.flatnonzero(inside))


def zoomed(which: tuple[int, ...], share: float) -> Scene:
    """Some cameras with another focal length."""
    cameras = list(SCENE.cameras)
    for k in which:
        own = cameras[k].interior
        interior = replace(own, focal_length_px=own.focal_length_px * (1.0 + share))
        cameras[k] = replace(cameras[k], interior=interior)
    return SCENE.with_cameras(tuple(cameras))


def only(result: CheckResult, which: tuple[int, ...], words: str) -> None:
    """One finding, about these cameras, in these words; the table agrees."""
    assert result.kinds == (Kind.LENS_CHANGED,), result.sentence
    assert result.findings[0].subjects == tuple(NAMES[k] for k in which), result.sentence
    assert words in result.sentence
    assert result.light is Light.RED
    changed = {c.name for c in result.cameras if c.verdict is Kind.LENS_CHANGED}
    assert changed == set(result.findings[0].subjects)


@pytest.mark.parametrize(("which", "by"), SHIFTS)
def test_most_cameras_shifted_alike_are_named_and_the_untouched_is_not(
    which: tuple[int, ...], by: tuple[float, float]
) -> None:
    result = checked(shifted(SCENE.observe(0.1, 41), which, by))
    only(result, which, f"are shifted by ({by[0]:+.1f}, ")


@pytest.mark.parametrize(
    "which", [(2, 3), *(pytest.param(w, marks=pytest.mark.slow) for w in ((0, 4), (1, 2, 4)))]
)
def test_some_cameras_shifted_alike_are_told_in_one_sentence(which: tuple[int, ...]) -> None:
    result = checked(shifted(SCENE.observe(0.1, 41), which, (1.5, 0.7)))
    only(result, which, "are shifted by (+1.5, +0.7) px")


@pytest.mark.slow
@pytest.mark.parametrize("which", [(0, 1, 2, 3), (1, 2, 3, 4), (0, 2, 3, 4)])
@pytest.mark.parametrize("share", [1e-3, -1e-2])
def test_most_focal_lengths_changed_alike_are_told_in_one_sentence(
    which: tuple[int, ...], share: float
) -> None:
    result = checked(zoomed(which, share).observe(0.1, 41))
    only(result, which, "focal lengths of")
    assert result.findings[0].value == pytest.approx(share, rel=0.1)


@pytest.mark.slow
def test_a_camera_that_moved_beside_shifted_ones_is_told_too() -> None:
    cameras = list(SCENE.cameras)
    pose = cameras[0].pose
    moved = replace(pose, position_rig_mm=pose.position_rig_mm + np.array([0.3, -0.2, 0.1]))
    cameras[0] = replace(cameras[0], pose=moved)
    scene = SCENE.with_cameras(tuple(cameras))
    result = checked(shifted(scene.observe(0.1, 41), (1, 2, 3, 4), (1.5, 0.7)))
    # Whether the one that moved was shifted, too, a movement hides.
    told = {f.kind: set(f.subjects) for f in result.findings}
    assert set(told) == {Kind.CAMERA_MOVED, Kind.LENS_CHANGED}, result.sentence
    assert told[Kind.CAMERA_MOVED] == {NAMES[0]}
    assert told[Kind.LENS_CHANGED] >= set(NAMES[1:])


@pytest.mark.slow
@pytest.mark.parametrize("which", [(3, 4), (1, 2)])
def test_two_cameras_that_were_turned_alike_are_still_told_as_moved(which: tuple[int, ...]) -> None:
    scene = SCENE
    for k in which:
        scene = calibrations.disturbed(
            scene, k, np.array([0.05, 0.0, 0.05]), np.array([2e-4, 0, 0])
        )
    result = checked(scene.observe(0.1, 41))
    assert set(result.kinds) == {Kind.CAMERA_MOVED}, result.sentence
