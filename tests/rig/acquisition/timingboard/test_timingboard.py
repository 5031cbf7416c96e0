"""Pictures of the LED board, rendered and read back; and pictures that cannot be read."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from simulated_rigs import STRONG, lens, placed

from common.errors import InputError
from rig.acquisition.timingboard.reading import TimingBoard, linear_light, read_board
from rig.simulation.flatsettings import BoardSettings, PlaceSettings
from rig.simulation.settings import SceneSettings, SensorSettings
from rig.simulation.studio import Shot, Studio

PLACE = PlaceSettings((0.0, 0.0, 20.0), (0.05, -1.0, 0.1))
SCENE = SceneSettings(with_head=False, board=BoardSettings(PLACE))
BOARD = TimingBoard()
CAMERAS = (
    placed(lens(1000, 26.0, STRONG), (0.0, -930.0, 0.0), "cam01", (0.0, 0.0, 0.0), 930.0),
    placed(lens(1000, 26.0, STRONG), (480.0, -720.0, -90.0), "cam02", (0.0, 0.0, 0.0), 870.0),
)
WITHIN_US = 50.0


def photograph(
    start_us: float, exposure_us: float, pixel_format: str, camera: str, level: float = 0.6
) -> np.ndarray:
    # As a photographer would: the board well exposed at every exposure time.
    sensor = SensorSettings(reference_exposure_us=exposure_us)
    scene = replace(SCENE, board=BoardSettings(PLACE, level=level))
    shot = Shot(
        camera,
        exposure_us,
        pixel_format=pixel_format,
        board_start_us=start_us,
        seed=(int(start_us),),
    )
    return Studio(CAMERAS, scene, sensor).photograph(shot)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pixel_format", "exposure_us", "camera"),
    [
        ("RGB8", 150.0, "cam01"),
        ("Mono8", 1000.0, "cam02"),
        ("Mono8", 8000.0, "cam01"),
        ("Mono16", 4000.0, "cam02"),
    ],
)
def test_the_exposure_is_read_to_a_twentieth_of_a_millisecond(
    pixel_format: str, exposure_us: float, camera: str
) -> None:
    start = 1_234_567.0 + 977.0 * exposure_us
    picture = photograph(start, exposure_us, pixel_format, camera)
    found = read_board(picture, BOARD)
    error = found.mid_us - (start + 0.5 * exposure_us) % BOARD.range_us
    assert abs(error) < WITHIN_US
    assert abs(error) < 4.0 * found.mid_sigma_us
    # Shorter than a few ticks the length is known poorly, and says so.
    assert abs(found.exposure_us - exposure_us) < max(
        0.03 * exposure_us, 4 * found.exposure_sigma_us
    )
    stated = read_board(picture, BOARD, exposure_us=exposure_us)
    assert abs(stated.mid_us - (start + 0.5 * exposure_us) % BOARD.range_us) < WITHIN_US


@pytest.mark.slow
def test_two_instants_differ_by_the_lag_between_them() -> None:
    start, lag = 700_000.0, 1370.0
    first = read_board(photograph(start, 4000.0, "RGB8", "cam01"), BOARD)
    second = read_board(photograph(start + lag, 4000.0, "RGB8", "cam02"), BOARD)
    sigma = np.hypot(first.mid_sigma_us, second.mid_sigma_us)
    assert second.mid_us - first.mid_us == pytest.approx(lag, abs=4.0 * sigma)
    assert sigma < 25.0


def test_one_marker_may_be_covered_but_not_two() -> None:
    picture = photograph(5000.0, 2000.0, "Mono8", "cam01")
    corners, numbers = found_markers(picture)
    cover_one = cover(picture, corners[numbers.index(40)])
    found = read_board(cover_one, BOARD)
    assert found.mid_us == pytest.approx(6000.0, abs=WITHIN_US)
    with pytest.raises(InputError, match="2 of the timing board's 4") as caught:
        read_board(cover(cover_one, corners[numbers.index(42)]), BOARD)
    assert caught.value.code == "input/board-not-seen"


def found_markers(picture: np.ndarray) -> tuple[list[np.ndarray], list[int]]:
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    corners, numbers, _ = detector.detectMarkers(picture)
    return list(corners), np.ravel(numbers).tolist()


def cover(picture: np.ndarray, corners: np.ndarray) -> np.ndarray:
    out = picture.copy()
    cv2.fillPoly(out, [np.round(corners).astype(np.int32).reshape(-1, 1, 2)], 128)
    return out


@pytest.mark.parametrize(
    ("picture", "code"),
    [
        (lambda: np.zeros((300, 400), np.uint8), "board-not-seen"),
        (lambda: photograph(0.0, 2000.0, "Mono8", "cam01", level=4.0), "board-saturated"),
        (lambda: photograph(0.0, 2000.0, "Mono8", "cam01", level=0.0), "board-dark"),
        (lambda: small(photograph(0.0, 2000.0, "Mono8", "cam01")), "board-too-small"),
    ],
)
def test_a_board_that_cannot_be_read_is_named(picture, code: str) -> None:  # noqa: ANN001
    with pytest.raises(InputError) as caught:
        read_board(picture(), BOARD)
    assert caught.value.code == f"input/{code}"
    assert "\n" not in str(caught.value)


def small(picture: np.ndarray) -> np.ndarray:
    return cv2.resize(picture, None, fx=0.4, fy=0.4, interpolation=cv2.INTER_AREA)


@pytest.mark.slow
def test_a_picture_exposed_twice_contradicts_itself() -> None:
    first, second = (
        photograph(start, 2000.0, "Mono16", "cam01").astype(np.uint32)
        for start in (5_000.0, 3_777_777.0)
    )
    with pytest.raises(InputError, match="contradict each other") as caught:
        read_board(((first + second) // 2).astype(np.uint16), BOARD)
    assert caught.value.code == "input/board-unclear"


def test_linear_light_inverts_the_srgb_curve() -> None:
    codes = np.array([[0, 10, 128, 255]], dtype=np.uint8)
    light = linear_light(codes, linear=False)[0]
    assert light[[0, 3]].tolist() == [0.0, 1.0]
    assert light[1] == pytest.approx(10 / 255 / 12.92)
    assert light[2] == pytest.approx(((128 / 255 + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize(
    "changes",
    [{"bits": 2}, {"tick_us": 0.0}, {"led_diameter_mm": 5.0}, {"marker_ids": (1, 1, 2, 3)}],
)
def test_boards_that_cannot_be_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(InputError, match="makes no board"):
        replace(BOARD, **changes)


def test_the_printed_face_has_its_markers_where_the_board_says() -> None:
    scale = 6.0
    face = BOARD.face(scale)
    corners, numbers = found_markers(np.asarray(face))
    middle = np.array(face.shape[::-1]) / 2.0 - 0.5
    for found, number in zip(corners, numbers, strict=True):
        wanted = BOARD.marker_corners_mm[BOARD.marker_ids.index(number)] * scale + middle
        assert np.abs(found.reshape(4, 2) - wanted).max() < 1.0
