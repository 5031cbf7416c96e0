"""Square markers: the whole printed picture fitted, middle or corners taken from it."""

from __future__ import annotations

import numpy as np

from calibration.detection import localmap
from calibration.detection.detections import Point
from calibration.detection.fitting import Fitted, fit_target, point_of, rejected
from calibration.detection.gates import Gates, Rejection, Rule
from calibration.detection.images import Picture
from calibration.detection.opencv import Markers
from calibration.detection.planes import homographies
from calibration.targets.kinds import MarkerCarrier
from calibration.targets.patterns import ModulePattern, marker_pattern
from geometry.arrays import Floats

_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def marker_points(
    picture: Picture, carrier: MarkerCarrier, markers: Markers, gates: Gates
) -> tuple[list[Point], list[Rejection]]:
    """Targets of a carrier in a picture with black markers on white.

    ``markers`` as found of the carrier's dictionary, each number once.
    """
    points: list[Point] = []
    rejections: list[Rejection] = []
    numbers = {p.number for p in carrier.places}
    for number, corners in zip(markers.ids.tolist(), markers.corners_px, strict=True):
        if number not in numbers:
            continue
        name, found = carrier.id_of(number), _marker(picture, carrier, number, corners, gates)
        if isinstance(found, Fitted):
            points += _targets(carrier, name, found)
        else:
            rejections.append(rejected(name, found, corners.mean(axis=0)))
    return points, rejections


def _marker(
    picture: Picture, carrier: MarkerCarrier, number: int, corners: Floats, gates: Gates
) -> Fitted | tuple[Rule, float, float]:
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    if sides.min() < gates.smallest_marker_px:
        return Rule.SIZE, float(sides.min()), gates.smallest_marker_px
    pattern = _black(carrier, number)
    half = carrier.size_mm / 2.0
    start = localmap.perspective_start(homographies(half * _CORNERS[None], corners[None])[0])
    modules = pattern.white.shape[0]
    found = fit_target(picture, pattern, start, float(sides.min()) / modules, gates)
    if not isinstance(found, Fitted):
        return found
    seen = localmap.to_picture(found.fit.parameters[: localmap.SIZE], half * _CORNERS)
    moved = float(np.linalg.norm(seen - corners, axis=1).max())
    # Corners as first found are off by up to about two pixels, or the blur's width.
    limit = 2.5 + 0.06 * float(sides.max()) + 2.0 * found.fit.blur_px
    return found if moved <= limit else (Rule.HOMOGRAPHY, moved, limit)


def _black(carrier: MarkerCarrier, number: int) -> ModulePattern:
    """The marker as it looks black on white: pictures of white ones are turned round before."""
    pattern = marker_pattern(carrier, number)
    return ModulePattern(
        pattern.white, pattern.module_mm, pattern.origin_mm, pattern.border_mm, pattern.dot
    )


def _targets(carrier: MarkerCarrier, name: str, found: Fitted) -> list[Point]:
    if not carrier.corners:
        return [point_of(name, found, np.zeros(2))]
    places = carrier.size_mm / 2.0 * _CORNERS
    return [point_of(f"{name}-{k}", found, place) for k, place in enumerate(places)]
