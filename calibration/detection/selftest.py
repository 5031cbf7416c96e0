"""Whether this OpenCV finds corners where they are: some builds are half a pixel off."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from calibration.detection import opencv
from calibration.detection.finding import find_targets
from calibration.detection.opencv import Bytes
from calibration.targets.kinds import CharucoPlate, TargetPlan
from calibration.targets.patterns import plate_pattern
from calibration.targets.rendering import PlacedPattern, photographed, render
from common.errors import DeviceError
from geometry.arrays import Floats, Ints
from geometry.camera import Body, Camera

LARGEST_BIAS_PX = 0.05
_OWN_LIMIT_PX = 0.01
_PLATE = CharucoPlate("self-test", 5, 4, 20.0, 15.0, "DICT_4X4_50")

Finder = Callable[[Bytes], tuple[Ints, Floats]]


def check_opencv(finder: Finder | None = None) -> Floats:
    """The bias (2,) in pixels of OpenCV's own corners on a board rendered exactly.

    ``finder`` gives numbers (m,) and places (m, 2) of corners; by default OpenCV's detector.
    Raises :class:`DeviceError` that names the bias when it is above ``LARGEST_BIAS_PX``, when
    corners are missing, or when this package's own corners, which start from OpenCV's markers,
    are off.
    """
    picture, truth = _board()
    bias = _bias(*(_plain if finder is None else finder)(picture), truth)
    own = find_targets(picture, TargetPlan("self-test", (_PLATE,)), explain=False)
    numbers = np.array([_PLATE.ids.index(i) for i in own.ids], dtype=np.int64)
    own_bias = _bias(numbers, np.asarray(own.pixel), truth)
    for which, value, limit in (
        ("its corners", bias, LARGEST_BIAS_PX),
        ("corners fitted from its markers", own_bias, _OWN_LIMIT_PX),
    ):
        if not np.abs(value).max() <= limit:
            raise DeviceError(
                "opencv-biased",
                f"OpenCV {opencv.version()} is not fit for measuring: {which} are off by "
                f"({value[0]:+.3f}, {value[1]:+.3f}) px on a board whose corners are known",
                "install opencv-python-headless 4.14 or newer",
            )
    return bias


@lru_cache(maxsize=1)
def require_opencv() -> None:
    """:func:`check_opencv` once per process, for whoever starts to detect."""
    check_opencv()


def _bias(numbers: Ints, places: Floats, truth: Floats) -> Floats:
    if len(numbers) < len(truth) // 2:
        return np.full(2, np.nan)
    return np.asarray(np.median(places - truth[numbers], axis=0))


def _plain(picture: Bytes) -> tuple[Ints, Floats]:
    plate = _PLATE
    squares = plate.columns, plate.rows
    return opencv.plain_charuco(
        picture, squares, plate.square_mm, plate.marker_mm, plate.dictionary
    )


@lru_cache(maxsize=1)
def _board() -> tuple[Bytes, Floats]:
    """A picture of the board, a little turned, and where its corners are."""
    body = Body(np.full(3, 50.0), np.zeros(3))
    camera = Camera("self-test", (480, 400), 0.005, 4.0, 8.0, 0.01, 10.0, body)
    turn = np.radians(7.0)
    rotation = np.array(
        [[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]]
    )
    middle = rotation @ np.array([_PLATE.size_mm[0] / 2.0, _PLATE.size_mm[1] / 2.0, 0.0])
    placed = PlacedPattern(plate_pattern(_PLATE), rotation, np.array([0.3, -0.2, 230.0]) - middle)
    truth = placed.pixels(camera, _PLATE.corner_grid_mm)
    return photographed(render(camera, [placed], 0.7), 1.0, 1), truth
