"""Boards of others in a picture: from whole chessboards, tags or dots to measured points."""

from __future__ import annotations

import numpy as np

from calibration.detection import localmap, opencv
from calibration.detection.crossings import Crossings, Guesses, crossing_points
from calibration.detection.detections import Point
from calibration.detection.fitting import Fitted, fit_target, point_of, rejected
from calibration.detection.gates import Gates, Rejection, Rule
from calibration.detection.images import Picture
from calibration.detection.opencv import Markers
from calibration.detection.ordering import (
    fitting_orders,
    local_axes,
    local_homographies,
    turn_deg,
)
from calibration.detection.planes import grown, homographies, mapped
from calibration.detection.ringreading import Dots
from calibration.targets.boardpatterns import DotsPattern, tag_modules
from calibration.targets.boards import AprilGrid, Chessboard, DotGrid
from geometry.arrays import Bools, Floats, Ints

_LARGE_PX = 1600
_SMALLEST_REACH = 0.6
"""Of an AprilGrid the plain part is seen, of a ChArUco plate whole squares: it may be smaller."""
_TAG_AWAY, _TAG_ASTRAY = 0.35, 0.06
"""Of a tag's side: how far tags may be from where others say, and corners from where found."""
_SCALE_SHARE, _SCALE_PX = 0.05, 3.0
"""How wrong a tag's size may look: its corners are known to about a pixel."""
_ALIKE, _MOST_TRIES = 1.6, 8
"""How far radii in one grid differ under perspective; how many sizes of dots are tried."""
_DOT_FREE = 1.8
"""Paper that belongs to a dot, in its radii."""

Found = tuple[list[Point], list[Rejection]]


def chessboard_points(picture: Picture, board: Chessboard, gates: Gates) -> Found:
    """Inner corners of a chessboard that is wholly in a picture with black squares on white."""
    pixels = _chessboard_corners(picture, board.columns - 1, board.rows - 1)
    if pixels is None:
        return [], []
    plane = board.grid_mm
    rows, columns = board.rows - 1, board.columns - 1
    orders = fitting_orders(plane, pixels, rows, columns)
    orders = [order for order in orders if _white_is_bright(picture, board, pixels[order])]
    chosen = _chosen(board, orders, plane, pixels)
    if not isinstance(chosen, np.ndarray):
        return [], chosen
    pixels = pixels[chosen]
    turned = ~board.white[1:, 1:].ravel()
    guesses = Guesses(np.arange(len(plane)), pixels, local_axes(plane, pixels, board.square_mm))
    return crossing_points(picture, Crossings(board.ids, plane, turned), guesses, gates)


def _chessboard_corners(picture: Picture, columns: int, rows: int) -> Floats | None:
    """Where the inner corners are, about; large pictures are searched made smaller first."""
    factor = -(-max(picture.size_px) // _LARGE_PX)
    if factor > 1:
        small = opencv.chessboard_corners(opencv.reduced(picture.grey, factor), columns, rows)
        if small is not None:
            return small * factor + (factor - 1) / 2.0
    return opencv.chessboard_corners(picture.grey, columns, rows)


def _white_is_bright(picture: Picture, board: Chessboard, pixels: Floats) -> bool:
    """Whether the inner squares that should be white are brighter than their neighbours."""
    grid = pixels.reshape(board.rows - 1, board.columns - 1, 2)
    middles = (grid[1:, 1:] + grid[:-1, 1:] + grid[1:, :-1] + grid[:-1, :-1]) / 4.0
    grey = opencv.sampled(picture.grey, middles)
    white = board.white[1:-1, 1:-1]
    return bool(grey[white].mean() > grey[~white].mean())


def _chosen(
    board: Chessboard | DotGrid, orders: list[Ints], plane: Floats, pixels: Floats
) -> Ints | list[Rejection]:
    """The one order of a board's points, or why there is none."""
    if not orders:
        return [rejected(board.name, (Rule.HOMOGRAPHY, 1.0, 0.0), pixels.mean(axis=0))]
    turns = [turn_deg(plane, pixels[order]) for order in orders]
    best = int(np.argmin(turns))
    if board.upright and turns[best] > board.upright_deg:
        why = Rule.UPRIGHT, turns[best], board.upright_deg
        return [rejected(board.name, why, pixels.mean(axis=0))]
    return orders[best]


def dot_grid_points(picture: Picture, board: DotGrid, dots: Dots, gates: Gates) -> Found:
    """Dots of a grid that is wholly in a picture with black dots on white.

    ``dots``: all that were found in the picture.
    """
    pixels = _dots_in_rows(board, dots)
    if pixels is None:
        return [], []
    plane = board.grid_mm
    chosen = _chosen(board, fitting_orders(plane, pixels, board.rows, board.columns), plane, pixels)
    if not isinstance(chosen, np.ndarray):
        return [], chosen
    pixels = pixels[chosen]
    maps = local_homographies(plane, pixels)
    points: list[Point] = []
    rejections: list[Rejection] = []
    for name, place, matrix in zip(board.ids, plane, maps, strict=True):
        found = _dot(picture, board, place, matrix, gates)
        if isinstance(found, Fitted):
            points.append(point_of(name, found, np.zeros(2)))
        else:
            rejections.append(rejected(name, found, mapped(matrix[None], place[None])[0][0]))
    return points, rejections


def _dots_in_rows(board: DotGrid, dots: Dots) -> Floats | None:
    """Dots that form the grid, about where they are, among letters, buttons and eyes."""
    radius = np.sqrt(np.abs(np.linalg.det(dots.axes_px)))
    tried: set[bytes] = set()
    for size in (np.inf, *np.unique(np.round(np.log(radius), 1))[::-1]):
        alike = np.full(len(dots), True) if np.isinf(size) else radius < _ALIKE * np.exp(size)
        if np.isfinite(size):
            alike &= radius > np.exp(size) / _ALIKE
        if alike.sum() < len(board.ids) or alike.tobytes() in tried or len(tried) > _MOST_TRIES:
            continue
        tried.add(alike.tobytes())
        centres = dots.centres_px[alike]
        found = opencv.dot_grid(centres, board.columns, board.rows, board.asymmetric)
        if found is not None:
            return found
    return None


def _dot(
    picture: Picture, board: DotGrid, place: Floats, matrix: Floats, gates: Gates
) -> Fitted | tuple[Rule, float, float]:
    radius = board.dot_radius_mm
    shift = np.array([[1.0, 0.0, place[0]], [0.0, 1.0, place[1]], [0.0, 0.0, 1.0]])
    start = localmap.perspective_start(matrix @ shift)
    seen = float(np.linalg.norm(np.linalg.inv(start[localmap.MATRIX].reshape(2, 2)), ord=-2))
    if seen * radius < gates.smallest_dot_px:
        return Rule.SIZE, seen * radius, gates.smallest_dot_px
    free = min(_DOT_FREE * radius, board.spacing_mm - 1.1 * radius)
    pattern = DotsPattern(((0.0, 0.0, 1.0, 1.0, 1, 1),), radius, (-free, -free, free, free))
    # A dot alone does not tell how it is turned: how its plane lies is known from the others.
    found = fit_target(picture, pattern, start, seen * radius, gates, held_map=True)
    if isinstance(found, Fitted):
        moved = float(np.linalg.norm(found.fit.centre_px - start[localmap.CENTRE]))
        limit = 0.5 + 0.15 * seen * radius
        return found if moved <= limit else (Rule.HOMOGRAPHY, moved, limit)
    return found


def april_grid_points(picture: Picture, grid: AprilGrid, markers: Markers, gates: Gates) -> Found:
    """Corners of the tags that are seen of a grid, black on white.

    ``markers`` as found of the grid's dictionary and border, each number once.
    """
    own, numbers = grid_tags(grid, markers)
    good = tags_agree(grid, own, numbers)
    strangers = [
        rejected(f"{grid.name} tag {own.ids[k]}", (Rule.HOMOGRAPHY, 1.0, _TAG_AWAY), c.mean(axis=0))
        for k, c in enumerate(own.corners_px)
        if not good[k]
    ]
    numbers, corners = numbers[good], own.corners_px[good]
    if not len(numbers):
        return [], strangers
    module = grid.tag_mm / len(tag_modules(grid, grid.first_tag))
    reach = min(grid.gap_mm, grid.border_modules * module)
    # Corners as found are off by a pixel or two where squares touch: neighbours say it better.
    plane = grid.corners_mm[numbers].reshape(-1, 2)
    pixel, axes = mapped(local_homographies(plane, corners.reshape(-1, 2)), plane)
    board = Crossings(
        grid.ids,
        grid.grid_mm,
        np.tile([True, False, True, False], len(grid.places)),
        smallest=_SMALLEST_REACH,
        astray=_TAG_ASTRAY * grid.tag_mm / reach,
    )
    which = (4 * numbers[:, None] + np.arange(4)).ravel()
    points, rejections = crossing_points(picture, board, Guesses(which, pixel, axes * reach), gates)
    return points, strangers + rejections


def grid_tags(grid: AprilGrid, markers: Markers) -> tuple[Markers, Ints]:
    """The grid's own tags, their corners from the board's upper left, and their places in it."""
    numbers = markers.ids - grid.first_tag
    mine = (numbers >= 0) & (numbers < len(grid.places))
    corners = np.roll(markers.corners_px[mine], grid.tag_turn_deg // 90, axis=1)
    return Markers(markers.ids[mine], corners), numbers[mine]


def tags_agree(grid: AprilGrid, tags: Markers, numbers: Ints) -> Bools:
    """Which tags (m,) lie on one plane as the grid has them; fewer than four agree with any."""
    if len(tags) < 4:
        return np.ones(len(tags), dtype=bool)
    plane, middles = grid.corners_mm[numbers].mean(axis=1), tags.corners_px.mean(axis=1)
    sides = np.linalg.norm(tags.corners_px - np.roll(tags.corners_px, 1, axis=1), axis=2)
    limit = _TAG_AWAY * float(np.median(sides))
    found = opencv.homography(plane, middles, limit)
    if found is None:
        return np.zeros(len(tags), dtype=bool)
    good = grown(plane, middles, found[1], limit)
    scales = tag_scales(grid, tags, numbers)
    room = _SCALE_SHARE + _SCALE_PX / float(np.median(sides))
    return np.asarray(good & (scales > 0.5) & (abs(np.median(scales) - 1.0) < room))


def tag_scales(grid: AprilGrid, tags: Markers, numbers: Ints) -> Floats:
    """How large each of four tags (m,) or more is against its distance from the others.

    1 when as described; less for tags that are turned, for they lead away from the others.
    """
    plane, middles = grid.corners_mm[numbers].mean(axis=1), tags.corners_px.mean(axis=1)
    matrix = homographies(plane[None], middles[None])
    whole = mapped(np.repeat(matrix, len(plane), axis=0), plane)[1]
    across = mapped(homographies(grid.corners_mm[numbers], tags.corners_px), plane)[1]
    return np.asarray((across * whole).sum(axis=(1, 2)) / (whole**2).sum(axis=(1, 2)))
