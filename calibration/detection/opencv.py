"""The one module of detection that calls OpenCV: its majors 4 and 5 look alike from here on.

Between the majors arrays lose a middle dimension and constants change their values, so every
array is reshaped here, and constants are looked up by name at each call and never stored.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2 as _cv2
import numpy as np
from numpy.typing import NDArray

from common.errors import InputError
from geometry.arrays import Bools, Floats, Ints

Bytes = NDArray[np.uint8]
AnyImage = NDArray[Any]

# The stubs of the two majors differ; seen as Any, the same source checks against both.
cv2: Any = _cv2

_cv2.setNumThreads(1)  # work is spread over pictures; threads within one would only compete


@dataclass(frozen=True, eq=False)
class Markers:
    """Square markers as found: ``ids`` (m,), ``corners_px`` (m, 4, 2), clockwise from the first."""

    ids: Ints
    corners_px: Floats

    def __len__(self) -> int:
        return len(self.ids)


def version() -> str:
    """OpenCV's version, for example ``5.0.0``."""
    return str(cv2.__version__)


def dictionary_names() -> tuple[str, ...]:
    """Names of all marker dictionaries, for example ``DICT_4X4_50``."""
    found: dict[int, str] = {}
    for name in sorted(dir(cv2.aruco)):
        if name.startswith("DICT_"):
            found.setdefault(getattr(cv2.aruco, name), name.upper())
    return tuple(found.values())


def _dictionary(name: str) -> Any:  # noqa: ANN401  OpenCV's own type, gone from no signature
    # OpenCV spells some with a small h; files of others do, too.
    name = name.upper()
    if name not in dictionary_names():
        raise InputError(
            "dictionary",
            f"there is no marker dictionary {name!r}",
            f"choose one of {', '.join(dictionary_names())}",
        )
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


def dictionary_size(name: str) -> int:
    """How many markers a dictionary has."""
    return len(_dictionary(name).bytesList)


def marker_modules(name: str, number: int) -> Bools:
    """Which modules of a marker are white, (n + 2, n + 2), with its black border."""
    dictionary = _dictionary(name)
    if not 0 <= number < len(dictionary.bytesList):
        raise InputError(
            "marker-number",
            f"there is no marker {number} in {name}",
            f"choose numbers from 0 to {len(dictionary.bytesList) - 1}",
        )
    side = int(dictionary.markerSize) + 2
    return np.asarray(dictionary.generateImageMarker(number, side, borderBits=1) > 127)


def detect_markers(
    grey: Bytes, dictionary: str, refine: bool = False, border_modules: int = 1
) -> Markers:
    """Markers of one dictionary in an 8-bit grey picture, their black border so many modules wide.

    Corners as found (about a pixel), or refined by OpenCV (about a quarter).
    """
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border_modules
    parameters.cornerRefinementMethod = (
        cv2.aruco.CORNER_REFINE_SUBPIX if refine else cv2.aruco.CORNER_REFINE_NONE
    )
    # By default a marker must be 3 % of the picture round its edge: in a picture of 6000
    # pixels that would hide markers of 40 pixels, which decode well.
    parameters.minMarkerPerimeterRate = min(0.03, 48.0 / max(grey.shape))
    # Printed white borders are often narrow; markers near the edge of the picture are gated later.
    parameters.minDistanceToBorder = 1
    detector = cv2.aruco.ArucoDetector(_dictionary(dictionary), parameters)
    corners, ids, _ = detector.detectMarkers(grey)
    if ids is None or len(corners) == 0:
        return Markers(np.zeros(0, dtype=np.int64), np.zeros((0, 4, 2)))
    places = np.asarray(corners, dtype=np.float64).reshape(-1, 4, 2)
    return Markers(np.asarray(ids, dtype=np.int64).reshape(-1), places)


def chessboard_corners(grey: Bytes, columns: int, rows: int) -> Floats | None:
    """Inner corners (rows * columns, 2) of a whole chessboard, about; None when there is none.

    The first is one of the outer four, and rows may run either way.
    """
    found, corners = cv2.findChessboardCornersSB(
        grey, (columns, rows), flags=cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE
    )
    return _grid_of(corners, columns * rows) if found else None


def chessboard_size(grey: Bytes) -> tuple[int, int] | None:
    """Squares across and down of whatever chessboard is in a picture, four each way at least."""
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_LARGER
    found, _, kinds = cv2.findChessboardCornersSBWithMeta(grey, (3, 3), flags)
    return (int(kinds.shape[1]) + 1, int(kinds.shape[0]) + 1) if found else None


def dot_grid(centres_px: Floats, columns: int, rows: int, asymmetric: bool) -> Floats | None:
    """Dots (rows * columns, 2) that form a grid, among dots (n, 2); None when none do.

    The first is one of the outer four, and rows may run either way.
    """
    if len(centres_px) < columns * rows:
        return None
    kind = cv2.CALIB_CB_ASYMMETRIC_GRID if asymmetric else cv2.CALIB_CB_SYMMETRIC_GRID
    dots = np.ascontiguousarray(centres_px, dtype=np.float32).reshape(-1, 1, 2)
    parameters = cv2.CirclesGridFinderParameters()
    for flags in (kind, kind | cv2.CALIB_CB_CLUSTERING):
        cv2.setRNGSeed(1)
        try:
            found, grid = cv2.findCirclesGrid(dots, (columns, rows), flags, None, parameters)
        except cv2.error:
            # OpenCV stops on dots that cannot form a grid at all, such as dots in one line.
            continue
        if found:
            return _grid_of(grid, columns * rows)
    return None


def _grid_of(places: AnyImage, count: int) -> Floats | None:
    points = np.asarray(places, dtype=np.float64).reshape(-1, 2)
    return points if len(points) == count and np.isfinite(points).all() else None


def plain_charuco(
    grey: Bytes, squares: tuple[int, int], square_mm: float, marker_mm: float, dictionary: str
) -> tuple[Ints, Floats]:
    """ChArUco corners as OpenCV itself finds them: numbers (m,) and places (m, 2)."""
    board = cv2.aruco.CharucoBoard(squares, square_mm, marker_mm, _dictionary(dictionary))
    corners, ids, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(grey)
    if ids is None or corners is None:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2))
    numbers = np.asarray(ids, dtype=np.int64).reshape(-1)
    return numbers, np.asarray(corners, dtype=np.float64).reshape(-1, 2)


def homography(plane: Floats, pixels: Floats, tolerance_px: float) -> tuple[Floats, Bools] | None:
    """Robust homography (3, 3) from a plane (n, 2) to pixels (n, 2), and which points obey it.

    None when fewer than four points agree.
    """
    if len(plane) < 4:
        return None
    cv2.setRNGSeed(1)
    matrix, mask = cv2.findHomography(
        np.asarray(plane, dtype=np.float64),
        np.asarray(pixels, dtype=np.float64),
        cv2.RANSAC,
        tolerance_px,
    )
    if matrix is None or mask is None or not np.isfinite(matrix).all():
        return None
    inside = np.asarray(mask).reshape(-1) > 0
    return (np.asarray(matrix, dtype=np.float64), inside) if inside.sum() >= 4 else None


def components(grey: Bytes, window_px: int, offset: float, dark: bool) -> tuple[Ints, Ints, Floats]:
    """Connected parts darker (or brighter) than their surroundings.

    Labels (H, W), statistics (parts, 5) left, top, width, height, area, and centroids
    (parts, 2). Part 0 is everything else.
    """
    kind = cv2.THRESH_BINARY_INV if dark else cv2.THRESH_BINARY
    window = min(window_px, 2 * (min(grey.shape) // 2) - 1) | 1
    shift = offset if dark else -offset
    mask = cv2.adaptiveThreshold(grey, 255, cv2.ADAPTIVE_THRESH_MEAN_C, kind, max(window, 3), shift)
    _, labels, statistics, centroids = cv2.connectedComponentsWithStats(mask, connectivity=4)
    return labels, np.asarray(statistics, dtype=np.int64), np.asarray(centroids, dtype=np.float64)


def reduced(grey: Bytes, factor: int) -> Bytes:
    """The picture made smaller by a whole factor, each pixel the mean of a block."""
    height, width = grey.shape[0] // factor, grey.shape[1] // factor
    whole = grey[: height * factor, : width * factor]
    return np.asarray(
        cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8
    )


def smoothed(grey: Bytes) -> Floats:
    """The mean of each pixel and its eight neighbours, (H, W)."""
    return np.asarray(cv2.blur(grey.astype(np.float64), (3, 3)))


def to_grey(image: AnyImage, order: str) -> AnyImage:
    """A colour picture (H, W, 3 or 4), ``order`` RGB or BGR, as grey (H, W) of the same depth."""
    alpha = "A" if image.shape[2] == 4 else ""
    return np.asarray(cv2.cvtColor(image, getattr(cv2, f"COLOR_{order}{alpha}2GRAY")))


def decode(data: bytes) -> AnyImage | None:
    """The picture in an encoded file, BGR if coloured, None when it cannot be decoded.

    Turned neither by the file's orientation mark nor otherwise: calibration is about the
    sensor's own rows and columns.
    """
    flags = cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    except cv2.error:
        return None
    return None if image is None else np.asarray(image)


def sampled(grey: Bytes, places_px: Floats) -> Floats:
    """Grey levels (n, m) at places (n, m, 2) between pixels; outside the picture its border's."""
    x, y = (np.ascontiguousarray(places_px[..., k], dtype=np.float32) for k in range(2))
    if x.size == 0:
        return np.zeros(x.shape)
    # OpenCV takes at most 32767 rows of places.
    parts = [
        cv2.remap(
            grey,
            x[k : k + 30000],
            y[k : k + 30000],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        for k in range(0, len(x), 30000)
    ]
    return np.concatenate(parts).astype(np.float64)


def pose_agreement(
    places_mm: Floats, pixels: Floats, size_px: tuple[int, int], tolerance_px: float
) -> Bools | None:
    """Which of n places (n, 3) appear where one pose of a camera of usual lens puts them, (n,).

    The camera is not known yet: a focal length of one and a half pictures is taken, and the
    tolerance must be wide. None when no pose is found.
    """
    width, height = size_px
    focal = 1.5 * max(size_px)
    matrix = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
    cv2.setRNGSeed(1)
    done, _, _, rows = cv2.solvePnPRansac(
        np.ascontiguousarray(places_mm, dtype=np.float64),
        np.ascontiguousarray(pixels, dtype=np.float64),
        matrix,
        None,
        reprojectionError=tolerance_px,
        iterationsCount=300,
        flags=cv2.SOLVEPNP_EPNP,
    )
    if not done or rows is None:
        return None
    mask = np.zeros(len(pixels), dtype=bool)
    mask[np.asarray(rows).reshape(-1)] = True
    return mask
