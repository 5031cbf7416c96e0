"""Rigs with wide lenses, calibrated with boards that people own, beside OpenCV.

    python -m benchmarks.boards [--boards chess grid dots plate] [--lenses barrel equidistant]

Rendered pictures of 640 x 480 pixels, blur 0.7 px, noise of 2 grey levels: two cameras 120 mm
apart, a board in eight places that is whole in each view. What is compared is the distance of the
cameras; both get the same pictures. OpenCV's points get their numbers from the truth, so that no
order of its own counts against it. "refused" stands where the pictures are refused, "does not
fit" where the calibration says so.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass

os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
)

import cv2
import numpy as np
from held_patterns import placed_carrier, true_pixels
from plain_opencv import opencvs_base_mm, plain_board
from scipy.spatial.transform import Rotation

from benchmarks.pages import table
from calibration.adjustment import CalibrationOptions, calibrate
from calibration.detection import opencv
from calibration.detection.opencv import Bytes
from calibration.detection.pictures import TakenPicture, detect_pictures
from calibration.observations import Observations
from calibration.targets.boards import AnyBoard, AprilGrid, Chessboard, DotGrid
from calibration.targets.kinds import CharucoPlate, TargetPlan
from calibration.targets.rendering import photographed, render
from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import Body, Camera, LensModel

SIZE_PX = 640, 480
BASE_MM, PLACES = 120.0, 8
MATCHED_PX = 2.0

OwnBoard = AnyBoard | CharucoPlate
EXACT = (0.0, 0.0, 0.0)
BOARDS: dict[str, OwnBoard] = {
    "chess": Chessboard(name="chess", columns=10, rows=7, square_mm=20.0, sigma_mm=EXACT),
    "grid": AprilGrid(name="grid", columns=5, rows=4, tag_mm=30.0, gap_mm=9.0, sigma_mm=EXACT),
    "dots": DotGrid(
        name="dots",
        columns=5,
        rows=9,
        spacing_mm=17.0,
        dot_radius_mm=6.0,
        asymmetric=True,
        sigma_mm=EXACT,
    ),
    "plate": CharucoPlate("plate", 10, 7, 20.0, 15.0, "DICT_5X5_100", sigma_mm=EXACT),
}


def lens(half_deg: float, terms: Sequence[float]) -> Camera:
    """A camera that sees ``half_deg`` in its corner."""
    radius = np.tan(np.radians(half_deg))
    body, pitch = Body(np.full(3, 50.0), np.zeros(3)), 0.005
    plain = Camera("c", SIZE_PX, pitch, 1.0, 8.0, 0.01, 10.0, body, distortion=np.array(terms))
    bent = (plain.pixels(np.array([radius, 0.0])) - plain.principal_point_px)[0]
    focal_mm = float(np.hypot(*SIZE_PX) / 2.0 / bent)
    return Camera("c", SIZE_PX, pitch, focal_mm, 8.0, 0.01, 10.0, body, distortion=np.array(terms))


BARREL, EQUIDISTANT = (-0.12, 0.015, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
LENSES: dict[str, tuple[tuple[Camera, LensModel], ...]] = {
    "barrel": ((lens(47.0, BARREL), LensModel.BROWN),),
    "equidistant": (
        (lens(47.0, EQUIDISTANT), LensModel.RATIONAL),
        (lens(55.0, EQUIDISTANT), LensModel.FISHEYE),
        (lens(60.0, EQUIDISTANT), LensModel.FISHEYE),
        (lens(60.0, EQUIDISTANT), LensModel.BROWN),
    ),
}


@dataclass(frozen=True, eq=False)
class Shown:
    """Pictures of a board by camera and frame, and where its points (n, 2) truly are in each."""

    board: OwnBoard
    pictures: dict[tuple[int, int], Bytes]
    true_px: dict[tuple[int, int], Floats]


def shown(board: OwnBoard, camera: Camera) -> Shown:
    """A board before two cameras, drawn anew until both see it whole."""
    random = np.random.default_rng([16, len(board.ids), round(camera.focal_length_px)])
    nominal = board.carrier().nominal_mm
    middle = (nominal.min(axis=0) + nominal.max(axis=0)) / 2.0
    pictures: dict[tuple[int, int], Bytes] = {}
    truth: dict[tuple[int, int], Floats] = {}
    while len(pictures) < 2 * PLACES:
        angles = random.uniform(-1.0, 1.0, 3) * [35.0, 35.0, 20.0]
        turn = np.asarray(Rotation.from_euler("xyz", angles, degrees=True).as_matrix())
        place = random.uniform([-90.0, -80.0, 110.0], [90.0, 80.0, 240.0])
        ways = [place - [x, 0.0, 0.0] - turn @ middle for x in (-BASE_MM / 2.0, BASE_MM / 2.0)]
        rims = [_rim_px(board, camera, turn, way) for way in ways]
        if not all(bool(((r > 4.0) & (r < np.array(SIZE_PX) - 5.0)).all()) for r in rims):
            continue
        frame = len(pictures) // 2
        for k, way in enumerate(ways):
            grey = render(camera, placed_carrier(board, turn, way), 0.7, 30.0, 220.0, 150.0)
            pictures[k, frame] = photographed(grey, 2.0, 100 * frame + k)
            truth[k, frame] = np.array(list(true_pixels(board, camera, turn, way).values()))
    return Shown(board, pictures, truth)


def _rim_px(board: OwnBoard, camera: Camera, turn: Floats, way: Floats) -> Floats:
    """Pixels of the corners of the board's sheet; NaN behind the camera."""
    left, top, right, bottom = placed_carrier(board, turn, way)[0].pattern.extent_mm
    rim = np.array([[x, y, 0.0] for x in (left, right) for y in (top, bottom)])
    seen = rim @ turn.T + way
    good = seen[:, 2:] > 5.0
    return camera.pixels(np.where(good, seen[:, :2] / np.where(good, seen[:, 2:], 1.0), np.nan))


def own(seen: Shown) -> Observations:
    """Points as this project finds them."""
    pictures = [
        TakenPicture(("left", "right")[k], f"{frame:02d}", picture)
        for (k, frame), picture in seen.pictures.items()
    ]
    return detect_pictures(pictures, TargetPlan("set", (seen.board,))).observations


def opencvs(seen: Shown) -> Observations:
    """Points as OpenCV finds them, with their true numbers."""
    rows: list[tuple[int, int, int]] = []
    pixels: list[Floats] = []
    for (k, frame), picture in seen.pictures.items():
        true = seen.true_px[k, frame]
        for place in _plain(seen.board, picture):
            away = np.linalg.norm(true - place, axis=1)
            if away.min() < MATCHED_PX:
                rows.append((k, frame, int(away.argmin())))
                pixels.append(place)
    camera, frame, target = np.array(rows).T
    pixel = np.array(pixels)
    return Observations(
        TargetPlan("set", (seen.board,)).target_set(),
        ("left", "right"),
        np.array([SIZE_PX] * 2),
        tuple(f"{f:02d}" for f in range(PLACES)),
        *(camera, frame, target, pixel, np.full_like(pixel, 0.05)),
    )


def _plain(board: OwnBoard, picture: Bytes) -> Floats:
    if not isinstance(board, CharucoPlate):
        return plain_board(board, picture)
    squares = board.columns, board.rows
    return opencv.plain_charuco(
        picture, squares, board.square_mm, board.marker_mm, board.dictionary
    )[1]


def rms_px(found: Observations, seen: Shown) -> str:
    """Error of points along one axis, and how many of all there are."""
    true = np.array(
        [
            seen.true_px[k, f][t]
            for k, f, t in zip(
                found.camera.tolist(), found.frame.tolist(), found.target.tolist(), strict=True
            )
        ]
    )
    count = 2 * PLACES * len(seen.board.ids)
    return f"{np.sqrt(((found.pixel - true) ** 2).mean()):.3f} px of {len(true) / count:.0%}"


def own_error(found: Observations, model: LensModel) -> str:
    """Error of the cameras' distance, or what is said instead."""
    done = calibrate(found, CalibrationOptions(cross_validate=False, lens=model))
    left, right = (c.pose.position_rig_mm for c in done.cameras)
    error = abs(float(np.linalg.norm(right - left)) / BASE_MM - 1.0)
    doubt = "does not fit: " if done.quality.unfit_lenses else ""
    return f"{doubt}{error:.3%}"


def said(work: Callable[[], str]) -> str:
    """What comes out, or that it was refused."""
    try:
        return work()
    except (InputError, cv2.error) as error:
        return f"refused ({str(error).splitlines()[0][:80]})"


def rows(board: OwnBoard, lens_name: str) -> list[tuple[str, ...]]:
    """Lines of the table."""
    lines: list[tuple[str, ...]] = []
    made: dict[float, tuple[Shown, Observations, Observations]] = {}
    for camera, model in LENSES[lens_name]:
        if camera.focal_length_mm not in made:
            seen = shown(board, camera)
            made[camera.focal_length_mm] = seen, own(seen), opencvs(seen)
        seen, ours, theirs = made[camera.focal_length_mm]
        corner = camera.normalised(np.array([-0.5, -0.5]))
        lines.append(
            (
                f"{lens_name}, {2.0 * np.degrees(np.arctan(np.hypot(*corner))):.0f} degrees",
                *(board.name, model.name.lower(), rms_px(ours, seen), rms_px(theirs, seen)),
                said(lambda ours=ours, model=model: own_error(ours, model)),
                said(
                    lambda theirs=theirs, model=model: (
                        f"{abs(opencvs_base_mm(theirs, model) / BASE_MM - 1.0):.3%}"
                    )
                ),
            )
        )
        print(lines[-1], flush=True)
    return lines


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--boards", nargs="+", choices=list(BOARDS), default=list(BOARDS))
    parser.add_argument("--lenses", nargs="+", choices=list(LENSES), default=list(LENSES))
    asked = parser.parse_args()
    lines = [
        line
        for name in asked.lenses
        for board in asked.boards
        for line in rows(BOARDS[board], name)
    ]
    head = ("lens", "board", "model", "points", "OpenCV's", "distance off", "OpenCV's")
    print(table(head, lines))


if __name__ == "__main__":
    main()
