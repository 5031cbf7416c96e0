"""What a setting did to pictures, of one camera or of all, and frames in other orders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import calibrations
import numpy as np
import pytest
from synthetic_scenes import Scene

from calibration.check import CheckResult, Kind, Light, check
from calibration.observations import Observations
from common.errors import InputError
from geometry.arrays import Floats

SCENE = calibrations.check_scene()
NAMES = tuple(c.name for c in SCENE.cameras)
WIDTH, HEIGHT = SCENE.cameras[0].image_size_px
MIDDLE = (np.array([WIDTH, HEIGHT]) - 1.0) / 2.0


def checked(observations: Observations) -> CheckResult:
    return check(calibrations.small_reference(), observations)


def only(result: CheckResult, kind: Kind, subjects: set[str], words: str) -> None:
    assert set(result.kinds) == {kind}, result.sentence
    assert {name for f in result.findings for name in f.subjects} == subjects
    assert words in result.sentence
    assert result.light is Light.RED


Change = Callable[[Floats], Floats]


def with_pixels(
    change: Change, cameras: tuple[int, ...] = (0, 1, 2, 3, 4), size: tuple[int, int] | None = None
) -> Observations:
    """Pixels of cameras changed, without those that leave the picture, whose size is new."""
    seen = SCENE.observe(0.1, 41)
    pixel, own = seen.pixel.copy(), np.isin(seen.camera, cameras)
    pixel[own] = change(pixel[own])
    sizes = seen.image_size_px.copy()
    sizes[list(cameras)] = size or (WIDTH, HEIGHT)
    inside = ((pixel >= 0.0) & (pixel <= sizes[seen.camera] - 1.0)).all(axis=1)
    changed = replace(seen, pixel=np.clip(pixel, 0.0, None), image_size_px=sizes)
    return changed.subset(np.flatnonzero(inside))


ALL: dict[str, tuple[Change, str]] = {
    "turned": (lambda p: 2.0 * MIDDLE - p, "all cameras are turned by 180"),
    "on the side": (
        lambda p: (p - MIDDLE) @ np.array([[0.0, 1.0], [-1.0, 0.0]]) + MIDDLE,
        "all cameras are turned by 90",
    ),
    "mirrored": (lambda p: MIDDLE + (p - MIDDLE) * [-1.0, 1.0], "all cameras are mirrored"),
    "cut": (lambda p: p - [8.0, -3.0], "all cameras are shifted by (-8.0, +3.0) px"),
    "resized": (
        lambda p: (p + 0.5) * (1.0 - 8.0 / WIDTH) - 0.5,
        "all cameras are resized by -13",
    ),
}


@pytest.mark.parametrize("name", ALL)
def test_what_a_setting_does_to_the_pictures_of_all_cameras_is_one_story(name: str) -> None:
    change, words = ALL[name]
    result = checked(with_pixels(change))
    only(result, Kind.LENS_CHANGED, set(NAMES), words)
    assert len(result.findings) == 1


@pytest.mark.parametrize("name", ["turned", "on the side", "mirrored"])
def test_of_two_cameras_the_one_with_turned_pictures_is_told(name: str) -> None:
    seen = with_pixels(ALL[name][0], (3,))
    result = checked(seen.subset(np.flatnonzero(np.isin(seen.camera, (2, 3)))))
    told = [f for f in result.findings if f.kind is not Kind.CAMERA_MISSING]
    assert [(f.kind, f.subjects) for f in told] == [(Kind.LENS_CHANGED, ("cam4",))], result.sentence


@pytest.mark.parametrize(("share", "words"), [(0.01, "+1.0 %"), (-0.2, "-20.0 %")])
def test_all_lenses_changed_by_much_are_no_prints_of_another_size(share: float, words: str) -> None:
    cameras = tuple(
        replace(
            c,
            interior=replace(c.interior, focal_length_px=c.interior.focal_length_px * (1 + share)),
        )
        for c in SCENE.cameras
    )
    result = checked(SCENE.with_cameras(cameras).observe(0.1, 41))
    only(result, Kind.LENS_CHANGED, set(NAMES), f"all cameras have changed by {words}")
    assert result.findings[0].value == pytest.approx(share, rel=1e-3)


@pytest.mark.parametrize(
    ("change", "size", "words"),
    [
        (lambda p: (p + 0.5) / 2.0 - 0.5, (WIDTH // 2, HEIGHT // 2), "binning or scaling by 0.5"),
        (lambda p: p - 4.0, (WIDTH - 8, HEIGHT - 8), "another crop"),
    ],
    ids=["binned", "cut"],
)
def test_pictures_of_another_size_are_told_and_the_other_cameras_checked(
    change: Change, size: tuple[int, int], words: str
) -> None:
    result = checked(with_pixels(change, (1,), size))
    only(result, Kind.LENS_CHANGED, {"cam2"}, words)
    result = checked(with_pixels(change, (1, 3), size))
    only(result, Kind.LENS_CHANGED, {"cam2", "cam4"}, words)
    with pytest.raises(InputError, match=words):
        checked(with_pixels(change, size=size))


@pytest.mark.parametrize(
    "soft", [(0, 1, 2, 3), pytest.param((0, 1, 2, 3, 4), marks=pytest.mark.slow)]
)
def test_where_too_few_cameras_are_sharp_nothing_else_is_told(soft: tuple[int, ...]) -> None:
    seen = SCENE.observe(0.1, 41)
    own = np.isin(seen.camera, soft)
    pixel = seen.pixel + own[:, None] * np.random.default_rng(5).normal(0.3, 0.6, seen.pixel.shape)
    seen = replace(seen, pixel=pixel, blur_px=np.where(own, 3.0, 0.8))
    reference = replace(calibrations.small_reference(), blur_px=np.full(5, 0.8))
    only(check(reference, seen), Kind.BLURRED, {NAMES[k] for k in soft}, "out of focus")


def test_two_cameras_that_are_left_are_checked_though_one_alone_sees_some_targets() -> None:
    # With this noise the equations of a target that one camera sees are singular to the last bit.
    seen = SCENE.observe(0.1, 871346366)
    result = checked(seen.subset(np.flatnonzero(np.isin(seen.camera, (1, 2)))))
    only(result, Kind.CAMERA_MISSING, {"cam1", "cam4", "cam5"}, "no picture with a target")
    # Two cameras 27 degrees apart see 10 um; where one alone sees a target, nothing could hide.
    hidden = [c.sensitivity.hidden_mm for c in result.cameras if c.sensitivity]
    assert len(hidden) == 2 and max(hidden) < 0.1, hidden


def with_order(orders: dict[int, tuple[int, ...]]) -> Scene:
    """Cameras whose pictures are those of other frames."""
    places = SCENE.places[1]
    other = {(k, f): places[g] for k, order in orders.items() for f, g in enumerate(order)}
    return replace(SCENE, seen_otherwise=other)


LATE, EARLY = (0, 0, 1, 2), (1, 2, 3, 3)


@pytest.mark.parametrize(
    "late",
    [
        {1: LATE, 3: LATE},
        {1: LATE, 3: EARLY},
        # Of three cameras that see the plate one is late: the middle of their rays is spoiled.
        {0: LATE, 4: EARLY},
        {1: EARLY, 4: LATE},
    ],
)
def test_two_cameras_of_other_frames_are_both_told(late: dict[int, tuple[int, ...]]) -> None:
    result = checked(with_order(late).observe(0.1, 41))
    only(result, Kind.UNSYNCHRONISED, {NAMES[k] for k in late}, "pair them with the frames")
    assert len(result.findings) == 2


def test_frames_in_no_order_that_has_a_name_are_told_one_by_one() -> None:
    # Camera 4 sees the plate in every frame.
    result = checked(with_order({3: (2, 0, 3, 1)}).observe(0.1, 41))
    only(result, Kind.UNSYNCHRONISED, {"cam4"}, "in another order than those of the others")
    assert "frame1 is frame3 of the others" in result.sentence
