"""What OpenCV gives by itself: the other side of comparisons, and videos frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from calibration.detection.opencv import Bytes, Markers
from calibration.observations import Observations
from calibration.targets.boards import AnyBoard, Chessboard, DotGrid
from geometry.arrays import Floats
from geometry.camera import LensModel


def plain_markers(grey: Bytes, dictionary: str) -> Markers:
    """Markers with OpenCV's own sub-pixel corners."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    corners, ids, _ = cv2.aruco.ArucoDetector(known, parameters).detectMarkers(grey)
    if ids is None or len(corners) == 0:
        return Markers(np.zeros(0, dtype=np.int64), np.zeros((0, 4, 2)))
    places = np.asarray(corners, dtype=np.float64).reshape(-1, 4, 2)
    return Markers(np.asarray(ids, dtype=np.int64).reshape(-1), places)


def plain_board(board: AnyBoard, image: Bytes) -> Floats:
    """The points of a board as OpenCV's own functions give them, in whatever order, (n, 2)."""
    if isinstance(board, Chessboard):
        size = board.columns - 1, board.rows - 1
        found, places = cv2.findChessboardCorners(image, size)
        if not found:
            return np.zeros((0, 2))
        stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
        places = cv2.cornerSubPix(image, places, (5, 5), (-1, -1), stop)
    elif isinstance(board, DotGrid):
        kind = cv2.CALIB_CB_ASYMMETRIC_GRID if board.asymmetric else cv2.CALIB_CB_SYMMETRIC_GRID
        found, places = cv2.findCirclesGrid(image, (board.columns, board.rows), flags=kind)
        if not found:
            return np.zeros((0, 2))
    else:
        parameters = cv2.aruco.DetectorParameters()
        parameters.markerBorderBits = board.border_modules
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        known = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        places, _, _ = cv2.aruco.ArucoDetector(known, parameters).detectMarkers(image)
    return np.asarray(places, dtype=np.float64).reshape(-1, 2)


FISHEYE_FLAGS = ("USE_INTRINSIC_GUESS", "FIX_SKEW", "RECOMPUTE_EXTRINSIC")


def fisheye_flag(name: str) -> int:
    """OpenCV 5 keeps them with all others."""
    return int(getattr(cv2.fisheye, f"CALIB_{name}", None) or getattr(cv2, f"CALIB_{name}"))


@dataclass(frozen=True)
class Pair:
    """Two cameras after OpenCV: their distance, and what its fit of each left, rms of a point."""

    base_mm: float
    rms_px: float


def opencvs_base_mm(seen: Observations, lens: LensModel) -> float:
    """The distance of both cameras after OpenCV, from the corners that both see."""
    return opencvs_pair(seen, lens).base_mm


def opencvs_pair(seen: Observations, lens: LensModel) -> Pair:
    """Both cameras after OpenCV, from the corners that both see."""
    nominal = seen.targets.carriers[0].nominal_mm
    shown: tuple[list[Floats], list[Floats], list[Floats]] = ([], [], [])
    for frame in range(len(seen.frames)):
        rows = [np.flatnonzero((seen.frame == frame) & (seen.camera == k)) for k in (0, 1)]
        both = np.intersect1d(seen.target[rows[0]], seen.target[rows[1]])
        if len(both) < 8:
            continue
        shown[0].append(nominal[both][None])
        for k in (0, 1):
            own = rows[k][np.isin(seen.target[rows[k]], both)]
            own = own[np.argsort(seen.target[own])]
            shown[1 + k].append(seen.pixel[own][None])
    width, height = size = tuple(int(v) for v in seen.image_size_px[0])
    if lens is LensModel.FISHEYE:
        middle = (width - 1.0) / 2.0, (height - 1.0) / 2.0
        start = [
            np.array([[0.56 * width, 0, middle[0]], [0, 0.56 * width, middle[1]], [0, 0, 1.0]])
            for _ in (0, 1)
        ]
        flags, poses, left = sum(map(fisheye_flag, FISHEYE_FLAGS)), [], []
        for k in (0, 1):
            found = cv2.fisheye.calibrate(
                shown[0], shown[1 + k], size, start[k], np.zeros(4), flags=flags
            )
            turns = [cv2.Rodrigues(v)[0] for v in found[3]]
            centres = [-r.T @ np.ravel(t) for r, t in zip(turns, found[4], strict=True)]
            poses.append(np.array(centres))
            left.append(found[0])
        base_mm = float(np.median(np.linalg.norm(poses[1] - poses[0], axis=1)))
        return Pair(base_mm, float(np.sqrt(np.mean(np.square(left)))))
    single = [[np.asarray(v, np.float32) for v in part] for part in shown]
    flags = cv2.CALIB_RATIONAL_MODEL if lens is LensModel.RATIONAL else 0
    lenses = [cv2.calibrateCamera(single[0], p, size, None, None, flags=flags) for p in single[1:]]
    found = cv2.stereoCalibrate(
        *single, lenses[0][1], lenses[0][2], lenses[1][1], lenses[1][2], size, flags=flags
    )
    left = np.square([one[0] for one in lenses])
    return Pair(float(np.linalg.norm(found[6])), float(np.sqrt(left.mean())))


def video_frames(path: Path) -> Iterator[Bytes]:
    """The frames of a video as grey pictures, one after the other."""
    video = cv2.VideoCapture(str(path))
    try:
        assert video.isOpened(), path
        while True:
            more, image = video.read()
            if not more:
                return
            yield np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    finally:
        video.release()
