"""Faces of carriers for the simulated studio: found where they should be, at their size."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.detection import opencv
from calibration.detection.finding import find_targets
from calibration.targets import faces
from calibration.targets.faces import carrier_face
from calibration.targets.kinds import (
    CarrierKind,
    CharucoPlate,
    MarkerCarrier,
    RingCarrier,
    TargetPlace,
    TargetPlan,
)
from common.errors import InputError

GRID = [(x, y, 0.0) for y in (0.0, 40.0) for x in (0.0, 45.0, 90.0)]
EXACT = (0.0, 0.0, 0.0)


def places(numbers: list[int]) -> tuple[TargetPlace, ...]:
    return tuple(TargetPlace(n, p, EXACT) for n, p in zip(numbers, GRID, strict=True))


@pytest.mark.parametrize(
    "kind",
    [
        CharucoPlate("plate", 6, 5, 20.0, 15.0, "DICT_4X4_50"),
        MarkerCarrier("markers", "DICT_4X4_50", 20.0, places([3, 1, 4, 0, 5, 9]), dot=True),
        RingCarrier("rings", 2.5, places([1, 2, 3, 4, 5, 6])),
        RingCarrier("white", 2.5, places([1, 2, 3, 4, 5, 6]), inverted=True),
    ],
)
def test_targets_are_found_on_a_face_where_they_are_printed(kind: CarrierKind) -> None:
    face = carrier_face(kind, px_per_mm=6.0)
    picture = opencv.decode(face.png)
    assert picture is not None
    assert picture.shape[:2] == (round(face.height_mm * 6.0), round(face.width_mm * 6.0))
    grey = np.pad(picture, 40, mode="edge")
    found = find_targets(grey, TargetPlan("set", (kind,)))
    carrier = kind.carrier()
    assert found.ids == carrier.ids
    plane = np.array(carrier.nominal_mm)[:, :2]
    off = found.pixel / 6.0 - plane
    # The curve of 8-bit codes moves edges by a share of a pixel, a sixth of a millimetre each,
    # alike on both sides of a target; a place that is wrong by a pixel would show as 0.17 mm.
    assert np.abs(off - off.mean(axis=0)).max() < 0.02


def test_what_has_no_face_is_refused() -> None:
    far = (TargetPlace(1, (0.0, 0.0, 0.0), EXACT), TargetPlace(2, (0.0, 0.0, 50.0), EXACT))
    with pytest.raises(InputError, match="is not flat"):
        carrier_face(RingCarrier("stand", 3.0, far))


def test_a_wall_gets_fewer_pixels_and_keeps_its_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(faces, "MOST_PIXELS", 2_000_000)
    wall = CharucoPlate("wall", 40, 30, 50.0, 35.0, "DICT_6X6_1000")
    face = carrier_face(wall)
    picture = opencv.decode(face.png)
    assert picture is not None
    assert 0.5 * faces.MOST_PIXELS < picture.size <= faces.MOST_PIXELS * 1.01
    # Forty squares and a quarter on either side, to a pixel.
    assert face.width_mm == pytest.approx(2025.0, abs=2025.0 / picture.shape[1])
