"""ChArUco plates: from markers to inner corners, each fitted to the grey levels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calibration.detection import opencv
from calibration.detection.detections import SIGMA_FLOOR_PX, Point
from calibration.detection.gates import Gates, Rejection, Rule
from calibration.detection.images import Picture
from calibration.detection.opencv import Markers
from calibration.detection.planes import (
    grown,
    homographies,
    mapped,
    neighbour_residuals,
    straightened,
)
from calibration.detection.saddle import GuardRule, Saddles, fit_saddles
from calibration.detection.windows import square_windows
from calibration.targets.kinds import CharucoPlate
from geometry.arrays import Bools, Floats, Ints

LARGEST_HALF_PX, SMALLEST_HALF_PX = 11, 4
_PIXEL_VARIANCE = 1.0 / 12.0
_BLURRED_PX = 2.5

LAYOUT_AGREEMENT = 0.7
"""Share of the markers that must lie as the plate has them: half of them do on a legacy plate."""


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


def plate_points(
    picture: Picture, plate: CharucoPlate, markers: Markers, gates: Gates
) -> tuple[list[Point], list[Rejection]]:
    """Inner corners of a plate in a picture with black squares on white.

    ``markers`` as found of the plate's dictionary, each number once.
    """
    report = _Report(plate)
    consistent, strangers = _consistent(plate, markers)
    report.rejections.extend(strangers)
    guesses = _guesses(plate, consistent)
    guesses = guesses.only(
        report.gate(guesses, Rule.SIZE, -guesses.square_px, -gates.smallest_square_px)
    )
    if len(guesses.numbers) == 0:
        return [], report.rejections
    half = int(np.clip(np.median(guesses.square_px) * 0.7, SMALLEST_HALF_PX, LARGEST_HALF_PX))
    guesses = guesses.only(_inside(report, guesses, picture, half, gates))
    if len(guesses.numbers) == 0:
        return [], report.rejections
    saddles = _fitted(picture, plate, guesses, half)
    room = float(np.median(guesses.square_px)) * 0.7
    wanted = int(np.ceil(4.5 * np.median(saddles.blur_px)))
    if np.median(saddles.blur_px) > _BLURRED_PX and half < min(room, wanted):
        half = int(min(room, wanted))
        guesses = guesses.only(_inside(report, guesses, picture, half, gates))
        saddles = _fitted(picture, plate, guesses, half)
    return _gated(picture, plate, guesses, saddles, half, gates, report), report.rejections


class _Report:
    """Rejections of corners, collected rule by rule."""

    def __init__(self, plate: CharucoPlate) -> None:
        self._plate = plate
        self.rejections: list[Rejection] = []

    def gate(self, guesses: Guesses, rule: Rule, measured: Floats, limit: float) -> Bools:
        """Which corners are within the limit; the others are noted.

        A limit below zero is a smallest value, both sides negated.
        """
        good = np.asarray(measured <= limit)
        for k in np.flatnonzero(~good):
            at = float(guesses.pixel[k, 0]), float(guesses.pixel[k, 1])
            name = self._plate.ids[guesses.numbers[k]]
            self.rejections.append(Rejection(name, rule, abs(float(measured[k])), abs(limit), at))
        return good


def plane_markers(plate: CharucoPlate, markers: Markers) -> tuple[Markers, Floats]:
    """The plate's own markers, and the middles of their squares on the plate (m, 2)."""
    squares = np.array(plate.marker_squares, dtype=np.float64)
    numbers = markers.ids - plate.first_marker
    mine = (numbers >= 0) & (numbers < len(squares))
    kept = Markers(markers.ids[mine], markers.corners_px[mine])
    return kept, (squares[numbers[mine]] + 0.5) * plate.square_mm


def agreeing(plate: CharucoPlate, markers: Markers) -> Bools:
    """Which of the plate's markers (m,) lie on one plane as the plate has them.

    Fewer than four agree with anything.
    """
    own, places = plane_markers(plate, markers)
    if len(own) < 4:
        return np.ones(len(own), dtype=bool)
    middles = own.corners_px.mean(axis=1)
    sides = np.linalg.norm(own.corners_px - np.roll(own.corners_px, 1, axis=1), axis=2)
    # Lens distortion bends the plane; a marker out of place is off by a square or more.
    limit = 0.35 * float(np.median(sides))
    found = opencv.homography(places, middles, limit)
    if found is None:
        return np.zeros(len(own), dtype=bool)
    return grown(places, middles, found[1], limit)


def believable(plate: CharucoPlate, markers: Markers) -> bool:
    """Whether the markers seen may lie on such a plate.

    On plates of odd columns most markers of the legacy pattern are merely shifted by a square
    and agree among themselves, so the pattern with which more of them agree is the true one.
    """
    good = agreeing(plate, markers)
    if len(good) == 0 or good.all():
        return True
    if good.mean() < LAYOUT_AGREEMENT:
        return False
    other = replace(plate, legacy=not plate.legacy)
    return plate.rows % 2 == 1 or int(agreeing(other, markers).sum()) <= int(good.sum())


def _consistent(plate: CharucoPlate, markers: Markers) -> tuple[Markers, list[Rejection]]:
    own, _ = plane_markers(plate, markers)
    good = agreeing(plate, markers)
    strangers = [
        Rejection(
            f"{plate.name} marker {own.ids[k]}",
            Rule.HOMOGRAPHY,
            1.0,
            0.35,
            (float(own.corners_px[k, 0, 0]), float(own.corners_px[k, 0, 1])),
        )
        for k in np.flatnonzero(~good)
    ]
    if not believable(plate, markers):
        good[:] = False
    return Markers(own.ids[good], own.corners_px[good]), strangers


def _guesses(plate: CharucoPlate, markers: Markers) -> Guesses:
    """Corners of the squares of all markers, each from its own marker's homography."""
    squares = np.array(plate.marker_squares)[markers.ids - plate.first_marker].reshape(-1, 2)
    half = plate.marker_mm / plate.square_mm / 2.0
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    plane = (squares + 0.5)[:, None] + half * corner
    matrix = homographies(plane, markers.corners_px)
    total: dict[int, list[tuple[Floats, Floats]]] = {}
    for step in corner:
        at = squares + (step + 1) // 2
        pixel, axes = mapped(matrix, at.astype(np.float64))
        inner = (at >= 1).all(axis=1) & (at < [plate.columns, plate.rows]).all(axis=1)
        inner &= np.isfinite(pixel).all(axis=1)
        for k in np.flatnonzero(inner):
            number = int((at[k, 1] - 1) * (plate.columns - 1) + at[k, 0] - 1)
            total.setdefault(number, []).append((pixel[k], axes[k]))
    numbers = np.array(sorted(total), dtype=np.int64)
    places = [np.mean([p for p, _ in total[n]], axis=0) for n in numbers]
    steps = [np.mean([a for _, a in total[n]], axis=0) for n in numbers]
    return Guesses(numbers, np.reshape(places, (-1, 2)), np.reshape(steps, (-1, 2, 2)))


def _inside(report: _Report, guesses: Guesses, picture: Picture, half: int, gates: Gates) -> Bools:
    """Which corners have their whole window in the picture."""
    width, height = picture.size_px
    far = np.array([width - 1.0, height - 1.0]) - guesses.pixel
    room = np.minimum(guesses.pixel, far).min(axis=1)
    return report.gate(guesses, Rule.EDGE, -room, -(half + max(gates.edge_px, 1.0)))


def _fitted(picture: Picture, plate: CharucoPlate, guesses: Guesses, half: int) -> Saddles:
    windows = square_windows(picture.levels, guesses.pixel, half, picture.gain)
    columns = plate.columns - 1
    at = np.stack([guesses.numbers % columns + 1, guesses.numbers // columns + 1], axis=1)
    axes = guesses.axes_px.copy()
    # The fit wants the white squares where both steps have one sign: else a quarter turn.
    turn = np.array([not plate.is_white(int(c), int(r)) for c, r in at])
    axes[turn] = np.stack([axes[turn][:, :, 1], -axes[turn][:, :, 0]], axis=-1)
    margin = (1.0 - plate.marker_mm / plate.square_mm) / 2.0
    return fit_saddles(windows, guesses.pixel, axes, GuardRule(margin))


def _gated(
    picture: Picture,
    plate: CharucoPlate,
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
    wander = np.where(saddles.converged & np.isfinite(moved), moved / (1.5 + 0.12 * square), 9.9)
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
    straight = _straight(picture, plate, guesses, saddles.pixel, good, gates)
    good &= _in_plane(plate, guesses, straight, good, gates, report)
    return [_point(plate, guesses, saddles, int(k)) for k in np.flatnonzero(good)]


def _straight(
    picture: Picture,
    plate: CharucoPlate,
    guesses: Guesses,
    pixel: Floats,
    good: Bools,
    gates: Gates,
) -> Floats:
    """The corners as a lens without distortion would show them, where distortion matters."""
    plane = plate.corner_grid_mm[guesses.numbers]
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
    plate: CharucoPlate,
    guesses: Guesses,
    pixel: Floats,
    good: Bools,
    gates: Gates,
    report: _Report,
) -> Bools:
    """Corners that lie where their neighbours say; the worst goes, then all are asked anew."""
    good = good.copy()
    plane = plate.corner_grid_mm[guesses.numbers]
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


def _point(plate: CharucoPlate, guesses: Guesses, saddles: Saddles, k: int) -> Point:
    x, y = saddles.pixel[k]
    sigma = np.sqrt(np.diag(saddles.covariance_px2[k]) + SIGMA_FLOOR_PX**2)
    blur = float(np.sqrt(max(saddles.blur_px[k] ** 2 - _PIXEL_VARIANCE, 0.0)))
    name = plate.ids[guesses.numbers[k]]
    return Point(name, (float(x), float(y)), (float(sigma[0]), float(sigma[1])), blur)
