"""Captures in which nothing was moved: told as that, and what comes of them is not to be used."""

from __future__ import annotations

from dataclasses import replace

import calibrations
import numpy as np
import pytest
from synthetic_scenes import Scene, face_rig, plate, plate_places

from calibration.adjustment import CalibrationOptions, calibrate
from calibration.adjustment.repeats import alike_words, places_shown
from calibration.files.calibrationfile import CalibrationRecord
from calibration.observations import Observations, TargetSet
from calibration.report import calibration_page

SIGMA_PX = 0.1


def plates(frames: list[int]) -> Scene:
    """A plate alone before three cameras; equal numbers are equal places."""
    carrier, points = plate(sigma_mm=0.0)
    different = plate_places(max(frames) + 1, 3)
    places = tuple(different[k] for k in frames)
    return Scene(face_rig(7)[2:5], TargetSet("p", (carrier,)), points, (places,))


@pytest.mark.parametrize(
    ("frames", "count", "few"),
    [
        ([0, 1, 2, 3, 4, 5, 6], 7, False),
        ([0, 0, 0], 1, True),
        ([0, 1, 0, 1, 0, 1], 2, True),
        ([0, 1, 2, 3, 4, 5, 6, 0], 7, False),
        ([0, 1, 2, 3, 4, 5] + 6 * [0], 6, True),
        ([0, 1, 2], 3, False),
    ],
)
def test_captures_that_are_alike_are_counted_as_one_place(
    frames: list[int], count: int, few: bool
) -> None:
    places = places_shown(plates(frames).observe(SIGMA_PX, 5))
    assert (len(places.groups), places.few) == (count, few)
    assert all(len({frames[k] for k in group}) == 1 for group in places.groups)


def test_the_same_pictures_twice_are_alike_and_a_step_of_a_twentieth_is_not() -> None:
    seen = plates([0, 1, 2]).observe(1e-6, 1)
    width = float(seen.image_size_px[0, 0])
    # Alike below 1/200 of the width: a third of that, and ten times as much.
    for share, count in ((0.0, 3), (0.0015, 3), (0.05, 4)):
        moved = seen.pixel[seen.frame == 0] + np.array([share * width, 0.0])
        again = added(seen, moved)
        assert len(places_shown(again).groups) == count, share


def added(seen: Observations, pixel: np.ndarray) -> Observations:
    """One capture more, with the first one's targets at these pixels."""
    own = seen.frame == 0
    return replace(
        seen,
        frames=(*seen.frames, "again"),
        camera=np.concatenate([seen.camera, seen.camera[own]]),
        frame=np.concatenate([seen.frame, np.full(own.sum(), len(seen.frames))]),
        target=np.concatenate([seen.target, seen.target[own]]),
        pixel=np.concatenate([seen.pixel, pixel]),
        sigma_px=np.concatenate([seen.sigma_px, seen.sigma_px[own]]),
        blur_px=np.concatenate([seen.blur_px, seen.blur_px[own]]),
    )


def test_a_stand_that_never_moves_repeats_nothing() -> None:
    seen = calibrations.small_scene().observe(SIGMA_PX, 2)
    fixed = np.array([c.fixed for c in seen.targets.carriers])
    still = seen.subset(np.flatnonzero(fixed[seen.targets.carrier_of[seen.target]]))
    assert len(still.pixel) and places_shown(still).groups == ()
    assert not places_shown(still).few


def test_one_plate_in_one_place_beside_a_design_is_not_called_fine() -> None:
    scene = plates([0, 0, 0])
    found = calibrate(scene.observe(SIGMA_PX, 4), CalibrationOptions(start=scene.cameras))
    assert found.doubtful_lenses == tuple(c.name for c in scene.cameras)
    first, second = found.quality.warnings[:2]
    assert first.startswith(
        "Do not use it: the pictures leave open the focal length of cam3, cam4, cam5"
    )
    assert second.startswith("3 captures show the targets in 1 place only (frame1, frame2, frame3")
    page = calibration_page(CalibrationRecord("one place", "", found))
    assert 'aria-label="red"' in page and "Do not use it" in page


def test_a_good_calibration_has_no_doubtful_lens_and_no_word_of_repeats() -> None:
    reference = calibrations.small_reference()
    assert reference.doubtful_lenses == ()
    assert not any("alike" in w or "Do not use" in w for w in reference.quality.warnings)


def test_many_alike_captures_are_named_by_three() -> None:
    seen = plates([0, 0, 0, 0, 1]).observe(SIGMA_PX, 6)
    assert alike_words(places_shown(seen), seen) == (
        "5 captures show the targets in 2 places only (frame1, frame2, frame3, ... are alike)"
    )
