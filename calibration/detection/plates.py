"""ChArUco plates: from markers to inner corners, each fitted to the grey levels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibration.detection import opencv
from calibration.detection.crossings import Crossings, Guesses, crossing_points
from calibration.detection.detections import Point
from calibration.detection.gates import Gates, Rejection, Rule
from calibration.detection.images import Picture
from calibration.detection.opencv import Markers
from calibration.detection.planes import grown, homographies, mapped
from calibration.targets.kinds import CharucoPlate
from geometry.arrays import Bools, Floats

LAYOUT_AGREEMENT = 0.7
"""Share of the markers that must lie as the plate has them: half of them do on a legacy plate."""


def plate_points(
    picture: Picture, plate: CharucoPlate, markers: Markers, gates: Gates
) -> tuple[list[Point], list[Rejection]]:
    """Inner corners of a plate in a picture with black squares on white.

    ``markers`` as found of the plate's dictionary, each number once.
    """
    consistent, strangers = _consistent(plate, markers)
    points, rejections = crossing_points(
        picture, _crossings(plate), _guesses(plate, consistent), gates
    )
    return points, strangers + rejections


def _crossings(plate: CharucoPlate) -> Crossings:
    rows, columns = np.indices((plate.rows - 1, plate.columns - 1)) + 1
    corners = zip(columns.ravel().tolist(), rows.ravel().tolist(), strict=True)
    turned = np.array([not plate.is_white(column, row) for column, row in corners])
    margin = (1.0 - plate.marker_mm / plate.square_mm) / 2.0
    return Crossings(plate.front_ids, plate.corner_grid_mm, turned, margin)


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


def marker_share(plate: CharucoPlate, markers: Markers) -> float | None:
    """Side of the markers in squares, as a picture shows it; None where nothing tells."""
    own, places = plane_markers(plate, markers)
    if len(own) < 4:
        return None
    square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) * plate.square_mm
    near = homographies(places[:, None] + square, own.corners_px)
    whole = homographies(places[None], own.corners_px.mean(axis=1)[None])
    steps = (mapped(m, places)[1] for m in (near, np.repeat(whole, len(places), axis=0)))
    sizes = [np.linalg.norm(step, axis=(1, 2)) for step in steps]
    return float(np.median(sizes[0] / sizes[1]))


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
