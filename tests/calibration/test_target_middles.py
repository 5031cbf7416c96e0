"""The middle of a carrier in a picture, from whichever of its targets are seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from held_patterns import true_pixels
from target_scenes import PLATE, camera, markers, middle_mm, places, rotation, shot

from calibration.detection.detections import Detections
from calibration.detection.finding import find_targets
from calibration.detection.middles import middle_of
from calibration.targets.kinds import CarrierKind, MarkerCarrier, TargetPlan

TURN = rotation(tilt_deg=25.0, pan_deg=-30.0, roll_deg=70.0)
AT_MM = np.array([5.0, -3.0, 260.0])


def seen(kind: CarrierKind, count: int | None = None) -> tuple[Detections, np.ndarray]:
    """Some targets of a carrier that is seen aslant, and where its middle truly is."""
    view = camera()
    shift = AT_MM - TURN @ middle_mm(kind)
    pixels = dict(list(true_pixels(kind, view, TURN, shift).items())[:count])
    n = len(pixels)
    found = Detections(
        view.image_size_px,
        tuple(pixels),
        np.array(list(pixels.values())),
        np.full((n, 2), 0.1),
        np.ones(n),
    )
    truth = AT_MM[:2] / AT_MM[2] * view.focal_length_px + view.principal_point_px
    return found, truth


@pytest.mark.parametrize("count", [None, -5])
@pytest.mark.parametrize("kind", [PLATE, markers(12)])
def test_the_middle_is_found_also_where_a_part_is_hidden(
    kind: CarrierKind, count: int | None
) -> None:
    found, truth = seen(kind, count)
    middle = middle_of(found, TargetPlan("t", (markers(2), kind) if kind is PLATE else (kind,)))
    assert middle is not None and middle.carrier == kind.name
    # The lens bends nothing, so a plane's picture is projective: exact but for OpenCV's single
    # precision, 24 bits of 360 px, a hundred times over for what lies outside of what is seen.
    assert middle.pixel == pytest.approx(truth, abs=2e-3)


def test_a_single_target_is_its_own_middle() -> None:
    kind = MarkerCarrier("one", "DICT_4X4_50", 40.0, places([7], 1, 1.0))
    found, truth = seen(kind)
    middle = middle_of(found, TargetPlan("t", (kind,)))
    assert middle is not None and middle.pixel == pytest.approx(truth, abs=1e-6)


def test_too_few_or_none_tell_nothing() -> None:
    plan = TargetPlan("t", (PLATE,))
    few, _ = seen(PLATE, 3)
    assert middle_of(few, plan) is None
    for count in (PLATE.columns - 1, PLATE.columns):  # on one line, but for the last
        row, _ = seen(PLATE, count)
        assert middle_of(row, plan) is None
    none = replace(
        few, ids=(), pixel=np.zeros((0, 2)), sigma_px=np.zeros((0, 2)), blur_px=np.zeros(0)
    )
    assert middle_of(none, plan) is None


def test_a_target_that_is_too_bright_to_measure_is_good_enough_to_aim_by() -> None:
    kind = MarkerCarrier("one", "DICT_4X4_50", 40.0, places([7], 1, 1.0))
    picture, truth = shot(kind, camera(), TURN, 400.0)
    plan = TargetPlan("t", (kind,))
    found = find_targets(np.minimum(2.0 * picture, 255.0).astype(np.uint8), plan)
    assert len(found) == 0
    middle = middle_of(found, plan)
    assert middle is not None
    # By the mean of its corners: 40 mm aslant reach 13 mm to either side of 400 mm, so halves of
    # 30 px differ by 3 %, and the mean is off by half of that; corners are seen to half a pixel.
    assert middle.pixel == pytest.approx(next(iter(truth.values())), abs=1.0)
