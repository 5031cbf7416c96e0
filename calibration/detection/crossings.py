"""Corners where two black and two white squares meet, on whatever board: fitted and gated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.detection.detections import SIGMA_FLOOR_PX, Point
from calibration.detection.gates import Gates, Rejection, Rule
from calibration.detection.images import Picture
from calibration.detection.planes import neighbour_residuals, straightened
from calibration.detection.saddle import GuardRule, Saddles, fit_saddles
from calibration.detection.windows import square_windows
from geometry.arrays import Bools, Floats, Ints

LARGEST_HALF_PX, SMALLEST_HALF_PX = 11, 4
_PIXEL_VARIANCE = 1.0 / 12.0
_BLURRED_PX = 2.5


@dataclass(frozen=True, eq=False)
class Crossings:
    """The corners of a board: ``ids`` (m,) and where they are on it, ``plane_mm`` (m, 2).

    ``turned`` (m,): where the white squares are not those in which both of the board's
    coordinates, from the corner, have one sign. ``margin_squares``: from a corner into its white
    squares to what else is in them. ``smallest``: share of the smallest square allowed.
    ``astray``: how far off the guesses may be, in squares, and 1.5 px more.
    """

    ids: tuple[str, ...]
    plane_mm: Floats
    turned: Bools
    margin_squares: float = 1.0
    smallest: float = 1.0
    astray: float = 0.12


@dataclass(frozen=True, eq=False)
class Guesses:
    """Where corners should be: their numbers (n,), places (n, 2) and board steps (n, 2, 2)."""

    numbers: Ints
    pixel: Floats
    axes_px: Floats

    def only(self, rows: Bools | Ints) -> Guesses:
        """Some of them."""
        return Guesses(self.numbers[rows], self.pixel[rows], self.axes_px[rows])

    @property
    def square_px(self) -> Floats:
        """The height of each square's parallelogram over its longer side, (n,)."""
        return np.asarray(
            np.abs(np.linalg.det(self.axes_px)) / np.linalg.norm(self.axes_px, axis=1).max(axis=1)
        )


def crossing_points(
    picture: Picture, board: Crossings, guesses: Guesses, gates: Gates
) -> tuple[list[Point], list[Rejection]]:
    """Corners of a board with black squares on white, from where they should be."""
    report = _Report(board)
    smallest = board.smallest * gates.smallest_square_px
    guesses = guesses.only(report.gate(guesses, Rule.SIZE, -guesses.square_px, -smallest))
    if len(guesses.numbers) == 0:
        return [], report.rejections
    half = int(np.clip(np.median(guesses.square_px) * 0.7, SMALLEST_HALF_PX, LARGEST_HALF_PX))
    guesses = guesses.only(_inside(report, guesses, picture, half, gates))
    if len(guesses.numbers) == 0:
        return [], report.rejections
    saddles = _fitted(picture, board, guesses, half)
    room = float(np.median(guesses.square_px)) * 0.7
    wanted = int(np.ceil(4.5 * np.median(saddles.blur_px)))
    if np.median(saddles.blur_px) > _BLURRED_PX and half < min(room, wanted):
        half = int(min(room, wanted))
        guesses = guesses.only(_inside(report, guesses, picture, half, gates))
        saddles = _fitted(picture, board, guesses, half)
    return _gated(picture, board, guesses, saddles, half, gates, report), report.rejections


class _Report:
    """Rejections of corners, collected rule by rule."""

    def __init__(self, board: Crossings) -> None:
        self._board = board
        self.rejections: list[Rejection] = []

    def gate(self, guesses: Guesses, rule: Rule, measured: Floats, limit: float) -> Bools:
        """Which corners are within the limit; the others are noted.

        A limit below zero is a smallest value, both sides negated.
        """
        good = np.asarray(measured <= limit)
        for k in np.flatnonzero(~good):
            at = float(guesses.pixel[k, 0]), float(guesses.pixel[k, 1])
            name = self._board.ids[guesses.numbers[k]]
            self.rejections.append(Rejection(name, rule, abs(float(measured[k])), abs(limit), at))
        return good


def _inside(report: _Report, guesses: Guesses, picture: Picture, half: int, gates: Gates) -> Bools:
    """Which corners have their whole window in the picture."""
    width, height = picture.size_px
    far = np.array([width - 1.0, height - 1.0]) - guesses.pixel
    room = np.minimum(guesses.pixel, far).min(axis=1)
    return report.gate(guesses, Rule.EDGE, -room, -(half + max(gates.edge_px, 1.0)))


def _fitted(picture: Picture, board: Crossings, guesses: Guesses, half: int) -> Saddles:
    windows = square_windows(picture.levels, guesses.pixel, half, picture.gain)
    axes = guesses.axes_px.copy()
    # The fit wants the white squares where both steps have one sign: else a quarter turn.
    turn = board.turned[guesses.numbers]
    axes[turn] = np.stack([axes[turn][:, :, 1], -axes[turn][:, :, 0]], axis=-1)
    return fit_saddles(windows, guesses.pixel, axes, GuardRule(board.margin_squares))


def _gated(
    picture: Picture,
    board: Crossings,
    guesses: Guesses,
    saddles: Saddles,
    half: int,
    gates: Gates,
    report: _Report,
) -> list[Point]:
    square = guesses.square_px
    contrast = 2.0 * saddles.contrast
    moved = np.linalg.norm(saddles.pixel - guesses.pixel, axis=1)
    good = np.ones(len(square), dtype=bool)
    clipped = _clipped(picture, guesses, half)
    misfit = saddles.noise / np.maximum(np.abs(contrast), 1e-3)
    wander = np.where(
        saddles.converged & np.isfinite(moved), moved / (1.5 + board.astray * square), 9.9
    )
    rules: tuple[tuple[Rule, Floats, float], ...] = (
        (Rule.SATURATION, clipped, gates.saturated_share),
        (Rule.CONTRAST, -contrast, -gates.contrast),
        (Rule.BLUR, saddles.blur_px / square, gates.blur_share),
        (Rule.FIT, misfit, gates.misfit),
        (Rule.HOMOGRAPHY, wander, 1.0),
    )
    for rule, measured, limit in rules:
        rows = np.flatnonzero(good)
        good[rows] = report.gate(guesses.only(rows), rule, measured[rows], limit)
    straight = _straight(picture, board, guesses, saddles.pixel, good, gates)
    good &= _in_plane(board, guesses, straight, good, gates, report)
    return [_point(board, guesses, saddles, int(k)) for k in np.flatnonzero(good)]


def _straight(
    picture: Picture,
    board: Crossings,
    guesses: Guesses,
    pixel: Floats,
    good: Bools,
    gates: Gates,
) -> Floats:
    """The corners as a lens without distortion would show them, where distortion matters."""
    plane = board.plane_mm[guesses.numbers]
    away = neighbour_residuals(plane[good], pixel[good]) if good.any() else np.zeros(0)
    if not (away > _plane_limit(guesses, gates)[good]).any():
        return pixel
    straight = pixel.copy()
    straight[good] = straightened(plane[good], pixel[good], picture.size_px)
    return straight


def _plane_limit(guesses: Guesses, gates: Gates) -> Floats:
    return np.asarray(np.maximum(gates.plane_px, gates.plane_share * guesses.square_px) + 1e-9)


def _clipped(picture: Picture, guesses: Guesses, half: int) -> Floats:
    """Share of the pixels about each corner that are at the camera's first or last level."""
    values = square_windows(picture.grey, guesses.pixel, half, 1.0).values
    return np.asarray(((values <= 0.0) | (values >= 255.0)).mean(axis=1))


def _in_plane(
    board: Crossings,
    guesses: Guesses,
    pixel: Floats,
    good: Bools,
    gates: Gates,
    report: _Report,
) -> Bools:
    """Corners that lie where their neighbours say; the worst goes, then all are asked anew."""
    good = good.copy()
    plane = board.plane_mm[guesses.numbers]
    limit = _plane_limit(guesses, gates)
    while good.any():
        rows = np.flatnonzero(good)
        excess = neighbour_residuals(plane[rows], pixel[rows]) / limit[rows]
        excess = np.where(np.isfinite(excess), excess, 0.0)
        worst = int(np.argmax(excess))
        if excess[worst] <= 1.0:
            break
        one = rows[worst : worst + 1]
        report.gate(guesses.only(one), Rule.HOMOGRAPHY, excess[worst : worst + 1], 1.0)
        good[one] = False
    return good


def _point(board: Crossings, guesses: Guesses, saddles: Saddles, k: int) -> Point:
    x, y = saddles.pixel[k]
    sigma = np.sqrt(np.diag(saddles.covariance_px2[k]) + SIGMA_FLOOR_PX**2)
    blur = float(np.sqrt(max(saddles.blur_px[k] ** 2 - _PIXEL_VARIANCE, 0.0)))
    name = board.ids[guesses.numbers[k]]
    return Point(name, (float(x), float(y)), (float(sigma[0]), float(sigma[1])), blur)
