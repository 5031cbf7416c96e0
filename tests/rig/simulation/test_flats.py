"""Coded targets appear where the camera model puts them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from simulated_rigs import STRONG, lens, placed

from common.errors import InputError
from geometry.camera import RigCamera
from rig.simulation import studio
from rig.simulation.flats import Flat, held_up, target
from rig.simulation.flatsettings import HeldSettings, PlaceSettings, TargetSettings
from rig.simulation.raytable import RayTables
from rig.simulation.settings import HeadSettings, SceneSettings, SensorSettings
from rig.simulation.studio import Shot, Studio

QUIET = SensorSettings(full_well_e=1e5, read_noise_e=1.0, depth_of_field=False)
CAMERA = placed(lens(1600, 30.0, STRONG), (180.0, -800.0, 120.0), target_mm=(0.0, 0.0, 0.0))
SHOT = Shot("cam01", 3000.0, pixel_format="Mono16")
"""Linear and not overexposed: the sRGB curve moves edges towards the dark by a tenth of a pixel,
and clipped white by more."""


@pytest.fixture(scope="module", autouse=True)
def _rays_worked_out_once() -> Iterator[None]:
    """Every studio here has the same lens, and its rays take nine tenths of a picture's time."""
    shared = RayTables()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(studio, "RayTables", lambda: shared)
        yield


def scene(*targets: TargetSettings) -> SceneSettings:
    return SceneSettings(with_head=False, targets=targets)


def on_flat(flat: Flat, across_mm: float, down_mm: float) -> np.ndarray:
    """A place on the face of a flat thing in the rig frame."""
    return flat.centre_rig_mm + across_mm * flat.right_rig + down_mm * flat.down_rig


def by_opencv(rig_camera: RigCamera, points_rig_mm: np.ndarray) -> np.ndarray:
    pose, camera = rig_camera.pose, rig_camera.camera
    turn, _ = cv2.Rodrigues(np.array(pose.rotation_rig_to_camera))
    shift = -pose.rotation_rig_to_camera @ pose.position_rig_mm
    pixels, _ = cv2.projectPoints(
        points_rig_mm, turn, shift, camera.camera_matrix, camera.distortion
    )
    return pixels.reshape(-1, 2)


@pytest.mark.parametrize(
    "dictionary", ["DICT_4X4_50", pytest.param("DICT_APRILTAG_36h11", marks=pytest.mark.slow)]
)
def test_marker_corners_are_found_where_they_are_projected(dictionary: str) -> None:
    places = [(-90.0, 0.0, 60.0), (70.0, 20.0, -50.0), (60.0, -30.0, 70.0), (-60.0, 10.0, -60.0)]
    facing = [(0.0, -1.0, 0.0), (0.4, -1.0, 0.2), (-0.2, -1.0, 0.3), (0.1, -1.0, -0.5)]
    targets = [
        TargetSettings("aruco", PlaceSettings(p, f), 60.0, dictionary, k)
        for k, (p, f) in enumerate(zip(places, facing, strict=True))
    ]
    picture = Studio([CAMERA], scene(*targets), QUIET).photograph(SHOT)
    picture = (picture >> 8).astype(np.uint8)
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(
        cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary)), settings
    )
    corners, numbers, _ = detector.detectMarkers(picture)
    assert sorted(np.ravel(numbers)) == [0, 1, 2, 3]
    square = 30.0 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    for found, number in zip(corners, np.ravel(numbers), strict=True):
        flat = target(targets[number])
        wanted = by_opencv(CAMERA, np.array([on_flat(flat, *corner) for corner in square]))
        # OpenCV's refinement draws the corners of a square inwards by 0.1 to 0.15 px (their tips
        # are rounded by any blur), evenly, so the middle is free of it.
        error = found.reshape(4, 2) - wanted
        assert np.abs(error).max() < 0.2
        assert np.abs(error.mean(axis=0)).max() < 0.05


def test_each_pixel_of_an_edge_is_as_dark_as_the_ink_in_it() -> None:
    settings = TargetSettings("aruco", PlaceSettings((-90.0, 0.0, 60.0), (0.3, -1.0, 0.1)), 60.0)
    light = Studio([CAMERA], scene(settings), replace(QUIET, lens_blur_px=0.0)).light(SHOT)[..., 0]
    flat = target(settings)
    square = np.array([[-30.0, 0.0], [30.0, 0.0], [0.0, -30.0], [0.0, 30.0], [-30.0, -30.0]])
    for place in by_opencv(CAMERA, np.array([on_flat(flat, *p) for p in square])):
        x, y = np.round(place).astype(int)
        patch = light[y - 5 : y + 6, x - 5 : x + 6]
        dark = (patch.max() - patch) / (patch.max() - patch.min())
        ink = ink_in_pixels(flat, np.arange(x - 5, x + 6), np.arange(y - 5, y + 6), 30.0)
        # 32 rays along a line know 1/32 of a pixel; the edge as a whole much better.
        assert np.abs(dark - ink).max() < 0.05
        assert abs((dark - ink).sum() / 11.0) < 0.01


def ink_in_pixels(flat: Flat, x: np.ndarray, y: np.ndarray, half_mm: float) -> np.ndarray:
    """Share of each pixel within the square, by 24 x 24 exact rays."""
    n = 24
    inner = (np.arange(n) + 0.5) / n - 0.5
    fine_x, fine_y = (np.add.outer(v, inner).ravel() for v in (x, y))
    grid = np.stack(np.meshgrid(fine_x, fine_y), axis=-1).reshape(-1, 2)
    ways = CAMERA.camera.rays(grid) @ CAMERA.pose.rotation_rig_to_camera
    eye = CAMERA.pose.position_rig_mm
    reach = ((flat.centre_rig_mm - eye) @ flat.facing_rig) / (ways @ flat.facing_rig)
    met = eye + reach[:, None] * ways - flat.centre_rig_mm
    across, down = met @ flat.right_rig, met @ flat.down_rig
    inside = (np.abs(across) < half_mm) & (np.abs(down) < half_mm)
    return inside.reshape(len(y), n, len(x), n).mean(axis=(1, 3))


def test_charuco_corners_are_found_where_they_are_projected() -> None:
    settings = TargetSettings(
        "charuco", PlaceSettings((0.0, 0.0, 0.0), (0.1, -1.0, 0.2)), 24.0, squares=(8, 6)
    )
    picture = Studio([CAMERA], scene(settings), QUIET).photograph(SHOT)
    picture = (picture >> 8).astype(np.uint8)
    from rig.simulation.flats import charuco_board

    corners, numbers, _, _ = cv2.aruco.CharucoDetector(charuco_board(settings)).detectBoard(picture)
    assert len(corners) == 35
    flat = target(settings)
    grid = np.stack(np.meshgrid(np.arange(1, 8) - 4.0, np.arange(1, 6) - 3.0), axis=-1)
    wanted = by_opencv(CAMERA, np.array([on_flat(flat, *(24.0 * g)) for g in grid.reshape(-1, 2)]))[
        np.ravel(numbers)
    ]
    error = np.linalg.norm(corners.reshape(-1, 2) - wanted, axis=1)
    assert error.max() < 0.1
    assert np.sqrt((error**2).mean()) < 0.07


def test_an_edge_within_a_pixel_gives_the_share_of_the_pixel(tmp_path: Path) -> None:
    halves = np.zeros((400, 2000), dtype=np.uint8)
    halves[:, 1000:] = 255
    path = tmp_path / "halves.png"
    cv2.imwrite(str(path), halves)
    camera = placed(lens(100), (0.0, -500.0, 0.0), target_mm=(0.0, 0.0, 0.0))
    steps = np.linspace(0.0, 1.0, 9)
    sums = []
    for step in steps:
        shift_mm = step * 500.0 / camera.camera.focal_length_px
        flat = TargetSettings("image", PlaceSettings((shift_mm, 0.0, 0.0)), 150.0, image=path)
        row = Studio([camera], scene(flat), QUIET).light(SHOT)[37, 40:60, 0]
        sums.append(row.sum() / row.max())
    # An edge moved by a pixel takes one pixel's light away, evenly; 16 rays know a sixteenth.
    assert np.abs(sums[0] - np.array(sums) - steps).max() < 1.0 / 16.0


@pytest.mark.slow
def test_a_target_hides_the_head_and_its_back_shows_no_code(tmp_path: Path) -> None:
    picture = np.full((50, 80, 3), (250, 10, 10), dtype=np.uint8)
    path = tmp_path / "red.png"
    cv2.imwrite(str(path), picture[..., ::-1])
    front = TargetSettings("image", PlaceSettings((0.0, -300.0, 0.0)), 80.0, image=path)
    back = TargetSettings(
        "image", PlaceSettings((0.0, -300.0, 0.0), (0.0, 1.0, 0.0)), 80.0, image=path
    )
    camera = placed(lens(80), (0.0, -900.0, 0.0))
    for settings, red in ((front, True), (back, False)):
        light = Studio(
            [camera], SceneSettings(head=HeadSettings(subdivisions=0), targets=(settings,)), QUIET
        ).light(Shot("cam01", 4000.0))
        middle = light[30, 40]
        assert (middle[0] > 10.0 * middle[2]) == red


@pytest.mark.parametrize(
    ("settings", "code"),
    [
        (TargetSettings("aruco", PlaceSettings((0, 0, 0)), 10.0, marker_id=50), "marker"),
        (TargetSettings("aruco", PlaceSettings((0, 0, 0)), 10.0, "DICT_NONE"), "dictionary"),
        (TargetSettings("charuco", PlaceSettings((0, 0, 0)), 10.0, squares=(1, 5)), "charuco"),
    ],
)
def test_impossible_targets_are_refused(settings: TargetSettings, code: str) -> None:
    with pytest.raises(InputError, match="give") as caught:
        target(settings)
    assert code in caught.value.code


def charuco_file(folder: Path, px_per_square: int) -> Path:
    """A ChArUco picture whose sides cannot be halved."""
    board = cv2.aruco.CharucoBoard(
        (9, 7), 20.0, 15.0, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    )
    face = board.generateImage((9 * px_per_square, 7 * px_per_square))
    path = folder / "plate.png"
    cv2.imwrite(str(path), np.pad(face, ((24, 24), (24, 23)), constant_values=255))
    return path


def test_a_picture_seen_from_afar_keeps_its_size(tmp_path: Path) -> None:
    path = charuco_file(tmp_path, 104)
    width_px = 9 * 104 + 47
    mm_per_px = 20.0 / 104
    settings = TargetSettings(
        "image", PlaceSettings((0.0, 0.0, 0.0)), width_px * mm_per_px, image=path, sharp=True
    )
    picture = Studio([CAMERA], scene(settings), QUIET).photograph(SHOT)
    board = cv2.aruco.CharucoBoard(
        (9, 7), 20.0, 15.0, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    )
    grey = (picture >> 8).astype(np.uint8)
    corners, numbers, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(grey)
    assert len(corners) == 48
    flat = target(settings)
    assert flat.albedo[0].ndim == 2  # a grey picture needs one channel
    plate = board.getChessboardCorners()[np.ravel(numbers), :2] - [90.0, 70.0]
    # The picture has one column less on its right: its middle is half a pixel left of the plate's.
    place = settings.place.position_rig_mm + np.array([1.0, 0.0, 0.0]) * mm_per_px / 2.0
    points = place + plate[:, :1] * flat.right_rig + plate[:, 1:] * flat.down_rig
    off = corners.reshape(-1, 2) - by_opencv(CAMERA, points)
    # 48 corners at 0.05 px each: their mean is known to 0.01 px, their scale over 500 px to 3e-5.
    assert np.abs(off.mean(axis=0)).max() < 0.05
    spread = corners.reshape(-1, 2) - corners.reshape(-1, 2).mean(axis=0)
    assert abs((off * spread).sum() / (spread**2).sum()) < 1e-4


def test_a_held_target_is_elsewhere_in_each_capture_and_still_within_one() -> None:
    held = HeldSettings((30.0, 20.0, 10.0), tilt_deg=25.0, roll_deg=90.0, seed=4)
    settings = TargetSettings("charuco", PlaceSettings((5.0, 6.0, 7.0)), 20.0, held=held)
    flat = target(settings)
    flat_axes = np.stack([flat.right_rig, flat.down_rig, flat.facing_rig])
    shown = [held_up(flat, held, capture) for capture in range(1, 200)]
    shifts = np.array([s.centre_rig_mm for s in shown]) - [5.0, 6.0, 7.0]
    assert (np.abs(shifts) <= [30.0, 20.0, 10.0]).all()
    assert (np.abs(shifts).max(axis=0) > [27.0, 18.0, 9.0]).all()
    tilts = np.degrees([np.arccos(s.facing_rig @ flat.facing_rig) for s in shown])
    assert 20.0 < tilts.max() <= 25.0
    for s in shown:
        axes = np.stack([s.right_rig, s.down_rig, s.facing_rig])
        assert np.allclose(axes @ axes.T, np.eye(3))
        assert np.linalg.det(axes) == pytest.approx(np.linalg.det(flat_axes))
    assert np.array_equal(held_up(flat, held, 7).centre_rig_mm, shown[6].centre_rig_mm)

    studio = Studio([CAMERA], scene(settings), QUIET)
    first, again, next_ = (studio.photograph(replace(SHOT, capture=n)) for n in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, next_)
