"""The table of cameras says what the findings say: the same cause, effect and state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import calibrations
import numpy as np
import pytest

from calibration.adjustment import Calibration
from calibration.check import CheckResult, Kind, check
from calibration.check.verdicts import CameraCheck
from calibration.observations import Observations
from geometry.arrays import Floats

SCENE = calibrations.check_scene()
NAMES = tuple(c.name for c in SCENE.cameras)
WIDTH, HEIGHT = SCENE.cameras[0].image_size_px
MIDDLE = (np.array([WIDTH, HEIGHT]) - 1.0) / 2.0
BLUR_PX = 0.8

Change = Callable[[Floats], Floats]


def checked(observations: Observations, reference: Calibration | None = None) -> CheckResult:
    return check(reference or calibrations.small_reference(), observations)


def with_pixels(
    change: Change, cameras: tuple[int, ...], size: tuple[int, int] = (WIDTH, HEIGHT)
) -> Observations:
    """Pixels of cameras changed, without those that leave the picture, whose size is new."""
    seen = SCENE.observe(0.1, 41)
    pixel, own = seen.pixel.copy(), np.isin(seen.camera, cameras)
    pixel[own] = change(pixel[own])
    sizes = seen.image_size_px.copy()
    sizes[list(cameras)] = size
    inside = ((pixel >= 0.0) & (pixel <= sizes[seen.camera] - 1.0)).all(axis=1)
    changed = replace(seen, pixel=np.clip(pixel, 0.0, None), image_size_px=sizes)
    return changed.subset(np.flatnonzero(inside))


def row(result: CheckResult, camera: int) -> CameraCheck:
    return next(c for c in result.cameras if c.name == NAMES[camera])


BLAMED: dict[str, tuple[Change, tuple[int, ...]]] = {
    "cut": (lambda p: p - 8.0, (1,)),
    "zoomed": (lambda p: MIDDLE + 1.002 * (p - MIDDLE) + 0.3, (3,)),
    "all cut": (lambda p: p - [8.0, -3.0], (0, 1, 2, 3, 4)),
}


@pytest.mark.parametrize("name", BLAMED)
def test_where_pictures_changed_the_table_has_the_effect_of_that(name: str) -> None:
    change, cameras = BLAMED[name]
    result = checked(with_pixels(change, cameras))
    (finding,) = result.findings
    assert finding.kind is Kind.LENS_CHANGED, result.sentence
    for k in cameras:
        # Image points were moved by so much; distortion changes that by a share of a percent.
        shift = np.linalg.norm(change(MIDDLE + 0.0) - MIDDLE)
        assert row(result, k).verdict is Kind.LENS_CHANGED
        assert row(result, k).effect_mm == finding.effect_mm > 0.02
        assert row(result, k).effect_px > 0.9 * shift
    others = set(range(5)) - set(cameras)
    assert all(row(result, k).verdict is Kind.FINE for k in others)
    assert all(row(result, k).effect_mm < 0.01 for k in others)


def test_where_a_camera_moved_the_table_has_the_effect_of_its_finding() -> None:
    result = checked(
        calibrations.disturbed(SCENE, 2, turn_rad=np.array([1e-4, 0.0, 0.0])).observe(0.1, 41)
    )
    (finding,) = result.findings
    assert finding.kind is Kind.CAMERA_MOVED
    assert row(result, 2).effect_mm == finding.effect_mm
    assert row(result, 2).effect_px == pytest.approx(finding.effect_px)


STATES: dict[str, tuple[Change, tuple[int, int], str]] = {
    "turned": (lambda p: 2.0 * MIDDLE - p, (WIDTH, HEIGHT), "not checked: turned"),
    "mirrored": (
        lambda p: MIDDLE + (p - MIDDLE) * [-1.0, 1.0],
        (WIDTH, HEIGHT),
        "not checked: mirrored",
    ),
    "on its side": (lambda p: p[:, ::-1], (HEIGHT, WIDTH), "not checked: turned"),
    "binned": (
        lambda p: (p + 0.5) / 2.0 - 0.5,
        (WIDTH // 2, HEIGHT // 2),
        "not checked: pictures of another size",
    ),
}


@pytest.mark.parametrize("name", STATES)
def test_a_camera_whose_pictures_are_not_checked_is_said_to_be_what_it_is(name: str) -> None:
    change, size, words = STATES[name]
    result = checked(with_pixels(change, (1,), size))
    assert (row(result, 1).verdict, row(result, 1).reason) == (Kind.CANNOT_TELL, words)
    assert all(row(result, k).verdict is Kind.FINE for k in (0, 2, 3, 4))


@pytest.mark.parametrize(
    "soft", [(1,), pytest.param((0, 1, 2, 3), marks=pytest.mark.slow)], ids=["one", "most"]
)
def test_a_soft_camera_is_said_to_be_out_of_focus(soft: tuple[int, ...]) -> None:
    seen = SCENE.observe(0.1, 41)
    seen = replace(seen, blur_px=np.where(np.isin(seen.camera, soft), 3.0, BLUR_PX))
    result = checked(seen, replace(calibrations.small_reference(), blur_px=np.full(5, BLUR_PX)))
    assert {row(result, k).reason for k in soft} == {"not checked: out of focus"}
    others = {row(result, k).verdict for k in range(5) if k not in soft}
    # Nothing is told where one camera is left: nor that it is fine.
    assert others == ({Kind.FINE} if len(soft) == 1 else {Kind.CANNOT_TELL})


def test_a_late_and_a_missing_camera_are_said_to_be_that() -> None:
    places = SCENE.places[1]
    late = {(1, f): places[max(f - 1, 0)] for f in range(SCENE.frame_count)}
    seen = replace(SCENE, seen_otherwise=late).observe(0.1, 41)
    result = checked(seen.subset(np.flatnonzero(seen.camera != 4)))
    assert row(result, 1).reason == "not checked: pictures of other frames"
    assert row(result, 4).reason == "not checked: no picture with a target"


def test_cameras_that_were_all_turned_are_not_called_fine() -> None:
    result = checked(with_pixels(lambda p: 2.0 * MIDDLE - p, (0, 1, 2, 3, 4)))
    assert {c.verdict for c in result.cameras} == {Kind.LENS_CHANGED}
    assert all(np.isnan(c.effect_mm) for c in result.cameras)
