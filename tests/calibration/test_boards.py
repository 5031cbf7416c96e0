"""Boards that people own: found as exactly as plates are, and never worse than by OpenCV."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import held_targets
import numpy as np
import pytest
import target_scenes as scenes
from plain_opencv import plain_board

from calibration.adjustment import calibrate
from calibration.detection.finding import find_targets
from calibration.detection.gates import Rule
from calibration.detection.pictures import TakenPicture, detect_pictures
from calibration.targets.boards import AnyBoard, AprilGrid, Chessboard, DotGrid
from calibration.targets.files import targets_from, targets_text
from calibration.targets.kinds import MarkerCarrier, TargetPlan
from common.errors import InputError

CHESS = Chessboard(name="chess", columns=8, rows=5, square_mm=20.0)
GRID = AprilGrid(name="grid", columns=4, rows=3, tag_mm=30.0, gap_mm=9.0)
DOTS = DotGrid(name="dots", columns=4, rows=5, spacing_mm=20.0, dot_radius_mm=6.0, asymmetric=True)
SQUARE_DOTS = DotGrid(
    name="rows", columns=5, rows=4, spacing_mm=25.0, dot_radius_mm=6.0, upright=True
)
BOARDS: tuple[AnyBoard, ...] = (CHESS, GRID, DOTS, SQUARE_DOTS)


@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.name)
def test_a_board_is_found_whole_and_no_worse_than_by_opencv(board: AnyBoard) -> None:
    view = scenes.camera((480, 400), k1=-0.1)
    image, truth = scenes.shot(board, view, scenes.rotation(35.0, 6.0, 20.0), 270.0)
    found = find_targets(image, TargetPlan("set", (board,)))
    assert found.ids == board.ids
    error = scenes.errors(found, truth)
    # The limit of plates: 0.02 px rms, of which a mean of 0.005.
    rms = float(np.sqrt((error**2).mean()))
    assert rms <= 0.02
    assert np.abs(error / found.sigma_px).max() < 5.0
    true = np.array(list(truth.values()))
    away = np.linalg.norm(plain_board(board, image)[:, None] - true, axis=2).min(axis=1)
    assert rms <= np.sqrt((away**2).mean() / 2.0)


@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.name)
def test_the_first_corner_is_known_however_the_board_is_turned(board: AnyBoard) -> None:
    view = scenes.camera((400, 400))
    roll = -50.0 if board is SQUARE_DOTS else 200.0
    image, truth = scenes.shot(board, view, scenes.rotation(10.0, -8.0, roll), 340.0)
    found = find_targets(image, TargetPlan("set", (board,)))
    assert found.ids == board.ids
    assert np.abs(scenes.errors(found, truth)).max() < 0.1


def test_a_board_that_must_be_upright_and_is_not_is_refused() -> None:
    image, _ = scenes.shot(SQUARE_DOTS, scenes.camera((400, 400)), scenes.rotation(0, 0, 75), 340.0)
    found = find_targets(image, TargetPlan("set", (SQUARE_DOTS,)))
    assert len(found) == 0
    assert [r.rule for r in found.rejections] == [Rule.UPRIGHT]


def test_tags_of_a_grid_are_used_though_the_others_are_out_of_the_picture() -> None:
    image, truth = scenes.shot(GRID, scenes.camera((480, 400)), scenes.rotation(20, 0, 9), 270.0)
    image = np.ascontiguousarray(image[:, 200:])
    found = find_targets(image, TargetPlan("set", (GRID,)))
    assert 16 <= len(found) < len(GRID.ids)
    moved = {name: place - [200.0, 0.0] for name, place in truth.items()}
    assert np.abs(scenes.errors(found, moved)).max() < 0.1


@pytest.mark.parametrize(
    ("board", "words"),
    [
        ("[[chessboards]]\ncolumns = 8\nrows = 6\nsquare_mm = 20.0", "odd number"),
        (
            "[[dot_grids]]\ncolumns = 4\nrows = 10\nspacing_mm = 10.0\ndot_radius_mm = 3.0\n"
            "asymmetric = true",
            "odd number of rows",
        ),
        ("[[dot_grids]]\ncolumns = 4\nrows = 9\nspacing_mm = 10.0\ndot_radius_mm = 3.0", "upright"),
        (
            "[[dot_grids]]\ncolumns = 4\nrows = 9\nspacing_mm = 10.0\ndot_radius_mm = 6.0\n"
            "upright = true",
            "diameter",
        ),
        ("[[aprilgrids]]\ncolumns = 4\nrows = 3\ntag_mm = 30.0\ngap_mm = 300.0", "tagSpacing"),
        ("[[chessboards]]\ncolumns = 3\nrows = 6\nsquare_mm = 20.0", "inner corners"),
        ("[[aprilgrids]]\ncolumns = 40\nrows = 30\ntag_mm = 30.0\ngap_mm = 3.0", "0 to 586"),
    ],
)
def test_a_board_that_cannot_serve_is_refused_with_the_way_out(board: str, words: str) -> None:
    text = f'schema = "rigwright.targets/1"\nname = "set"\n{board}\nname = "b"\n'
    with pytest.raises(InputError) as raised:
        targets_from(text)
    assert words in f"{raised.value.problem} {raised.value.remedy}"


def test_boards_are_written_and_read_again() -> None:
    plan = TargetPlan("set", (*BOARDS[:1], replace(GRID, from_top=True, border_modules=1), DOTS))
    assert targets_from(targets_text(plan)) == plan


@lru_cache
def seen(board: AnyBoard) -> np.ndarray:
    """A picture of a board in which its first corner is upper left."""
    return scenes.shot(board, scenes.camera((560, 460)), scenes.rotation(15, 0, 8), 280.0)[0]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (replace(GRID, border_modules=1), "border_modules = 2"),
        (replace(GRID, tag_turn_deg=0), "tag_turn_deg = 180"),
        (replace(GRID, from_top=True), "from_top = false"),
        (replace(GRID, columns=3, rows=4), "4 columns"),
        (replace(GRID, gap_mm=18.0), "are narrower"),
        (replace(CHESS, columns=7, rows=4), "8 x 5 squares"),
        (
            MarkerCarrier("tags", "DICT_APRILTAG_36h11", 30.0, scenes.places(range(12), 4, 39.0)),
            "aprilgrids",
        ),
    ],
    ids=["border", "turn", "rows", "columns", "gap", "size", "markers"],
)
def test_a_board_described_wrongly_is_told(given: AnyBoard | MarkerCarrier, words: str) -> None:
    truth = CHESS if given.name == "chess" else GRID
    image = seen(truth)
    found = find_targets(image, TargetPlan("set", (given,)))
    assert len(found.findings) == 1
    assert words in f"{found.findings[0].problem}; {found.findings[0].remedy}"


@pytest.mark.parametrize(("marker_mm", "told"), [(15.0, False), (9.0, True), (19.5, True)])
def test_markers_of_another_size_than_told_are_named(marker_mm: float, told: bool) -> None:
    plate = replace(scenes.PLATE, marker_mm=marker_mm)
    image, _ = scenes.shot(scenes.PLATE, scenes.camera(), scenes.rotation(20, 0, 8), 300.0)
    found = find_targets(image, TargetPlan("set", (plate,)))
    problems = [finding.problem for finding in found.findings]
    assert bool(problems) == told
    assert all("are about 0.7" in problem for problem in problems)
    # A wrong size of the markers moves no corner: they are where the squares meet.
    assert not told or len(found) in (0, len(plate.ids))


def test_opencv_spells_dictionaries_in_two_ways() -> None:
    mixed = scenes.markers(), replace(scenes.markers(), name="other", dictionary="DICT_4x4_50")
    with pytest.raises(InputError, match="shows marker 0 of another carrier"):
        TargetPlan("set", mixed)
    grid = replace(GRID, dictionary="DICT_APRILTAG_36h11")
    image = seen(GRID)
    assert len(find_targets(image, TargetPlan("set", (grid,)))) == len(GRID.ids)


@pytest.mark.slow
@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.name)
def test_a_rig_is_calibrated_with_a_board_from_nothing(board: AnyBoard) -> None:
    cameras = held_targets.rig(480)
    # Upright boards are held with less turn: a hand turns by up to the tilt about each axis.
    shown = held_targets.shown(board, cameras, held_targets.held(6, 3, 32.0))
    pictures = [
        TakenPicture(camera, frame, image)
        for camera, frames in shown.items()
        for frame, image in frames.items()
    ]
    found = detect_pictures(pictures, TargetPlan("set", (board,)))
    calibration = calibrate(found.observations)
    middles = np.array([c.pose.position_rig_mm for c in calibration.cameras])
    true = np.array([c.pose.position_rig_mm for c in cameras])
    first, second = np.triu_indices(len(true), 1)
    length = np.linalg.norm(middles[first] - middles[second], axis=1)
    # 0.01 px of 480 over a board of a third of the picture, from six places: 1 in 10,000; the
    # board's own size is exact. A tenth of a per cent is what is asked of lengths.
    assert length == pytest.approx(np.linalg.norm(true[first] - true[second], axis=1), rel=1e-3)
