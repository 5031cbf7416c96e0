"""Targets in one picture: the entry to detection."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from calibration.detection.boards import (
    april_grid_points,
    chessboard_points,
    dot_grid_points,
)
from calibration.detection.carriers import carrier_strangers
from calibration.detection.detections import Detections, PictureProblem, Point
from calibration.detection.diagnosis import FEW, diagnose
from calibration.detection.gates import Gates, Rejection, Rule
from calibration.detection.images import Picture, picture_from, read_picture
from calibration.detection.markers import marker_points
from calibration.detection.opencv import AnyImage, Markers
from calibration.detection.plates import plate_points
from calibration.detection.ringreading import find_dots
from calibration.detection.rings import ring_dots, ring_points
from calibration.detection.seeing import MarkerSearch
from calibration.targets.boards import AprilGrid, Chessboard, DotGrid
from calibration.targets.kinds import (
    CarrierKind,
    CharucoPlate,
    MarkerCarrier,
    RingCarrier,
    TargetPlan,
)

Source = Picture | AnyImage | Path


def find_targets(
    image: Source, plan: TargetPlan, gates: Gates | None = None, explain: bool = True
) -> Detections:
    """All targets of ``plan`` that a picture shows and that pass the gates.

    ``image``: a file, a grey array (H, W) of 8 or 16 bits, a colour array in the order BGR, or a
    :class:`Picture`. With ``explain`` a picture with nothing in it is looked at again for the
    usual reasons (mirrored, another board); that takes several times as long. Raises a one-line
    :class:`InputError` for what is not a picture.
    """
    # The matrices are small: threads would only get in each other's way.
    with threadpool_limits(1):
        return _found(as_picture(image), plan, Gates() if gates is None else gates, explain)


def _found(picture: Picture, plan: TargetPlan, gates: Gates, explain: bool) -> Detections:
    points: list[Point] = []
    rejections: list[Rejection] = []
    sights: dict[bool, MarkerSearch] = {}
    for inverted in sorted({c.inverted for c in plan.carriers}):
        carriers = [c for c in plan.carriers if c.inverted == inverted]
        sight = MarkerSearch(picture.negative if inverted else picture)
        sights[inverted] = sight
        for part in (
            _square_targets(sight, carriers, gates),
            _rings(sight.picture, carriers, gates),
            *_boards(sight, carriers, gates),
        ):
            points += part[0]
            rejections += part[1]
    points, doubles = _unique(points)
    points, strangers = carrier_strangers(plan, points, picture.size_px, gates)
    rejections += doubles + strangers
    findings = diagnose(sights, plan, gates, len(points)) if explain else ()
    if any(f.code == "mirrored" for f in findings):
        points = []
    return _detections(plan, picture, points, rejections, findings)


def as_picture(image: Source) -> Picture:
    """Whatever detection takes, as a picture."""
    if isinstance(image, Picture):
        return image
    return read_picture(image) if isinstance(image, Path) else picture_from(image)


def _square_targets(
    sight: MarkerSearch, carriers: Sequence[CarrierKind], gates: Gates
) -> tuple[list[Point], list[Rejection]]:
    points: list[Point] = []
    rejections: list[Rejection] = []
    squares = [c for c in carriers if isinstance(c, CharucoPlate | MarkerCarrier)]
    for dictionary in sorted({c.dictionary for c in squares}):
        markers, doubles = once(sight.markers(dictionary, squares))
        mine = [c for c in squares if c.dictionary == dictionary]
        rejections += [d for d in doubles if _wanted(mine, d)]
        for carrier in mine:
            if isinstance(carrier, CharucoPlate):
                found = plate_points(sight.picture, carrier, markers, gates)
                if carrier.back_mm is not None and len(found[0]) <= FEW:
                    # Some codes look the same in a mirror: a few corners of the front are no front.
                    back = _back_points(sight.picture, carrier, gates)
                    found = max(found, back, key=lambda side: len(side[0]))
            else:
                found = marker_points(sight.picture, carrier, markers, gates)
            points += found[0]
            rejections += found[1]
    return points, rejections


def _back_points(
    picture: Picture, plate: CharucoPlate, gates: Gates
) -> tuple[list[Point], list[Rejection]]:
    """Corners on a plate's back: those of its front in a mirror."""
    sight = MarkerSearch(picture.mirrored)
    markers, _ = once(sight.markers(plate.dictionary, (plate,)))
    points, rejections = plate_points(sight.picture, plate, markers, gates)
    far = picture.size_px[0] - 1.0
    back = dict(zip(plate.front_ids, plate.back_ids, strict=True))
    return [
        replace(p, target=back[p.target], pixel=(far - p.pixel[0], p.pixel[1])) for p in points
    ], [
        replace(r, target=back.get(r.target, r.target), pixel=(far - r.pixel[0], r.pixel[1]))
        for r in rejections
    ]


def once(markers: Markers) -> tuple[Markers, list[Rejection]]:
    """Markers whose number was found once, and rejections of the others."""
    counts = Counter(markers.ids.tolist())
    single = np.array([counts[i] == 1 for i in markers.ids.tolist()], dtype=bool)
    doubles = [
        Rejection(
            f"marker {markers.ids[k]}",
            Rule.UNIQUE_ID,
            float(counts[int(markers.ids[k])]),
            1.0,
            (float(markers.corners_px[k, 0, 0]), float(markers.corners_px[k, 0, 1])),
        )
        for k in np.flatnonzero(~single)
    ]
    return Markers(markers.ids[single], markers.corners_px[single]), doubles


def _wanted(carriers: Iterable[CharucoPlate | MarkerCarrier], double: Rejection) -> bool:
    number = int(double.target.split()[-1])
    return any(
        number - c.first_marker in range(len(c.marker_squares))
        if isinstance(c, CharucoPlate)
        else number in {p.number for p in c.places}
        for c in carriers
    )


def _rings(
    picture: Picture, carriers: Sequence[CarrierKind], gates: Gates
) -> tuple[list[Point], list[Rejection]]:
    rings = [c for c in carriers if isinstance(c, RingCarrier)]
    if not rings:
        return [], []
    return ring_points(picture, ring_dots(picture, gates), rings, gates)


def _boards(
    sight: MarkerSearch, carriers: Sequence[CarrierKind], gates: Gates
) -> Iterator[tuple[list[Point], list[Rejection]]]:
    picture = sight.picture
    for board in carriers:
        if isinstance(board, Chessboard):
            yield chessboard_points(picture, board, gates)
        elif isinstance(board, DotGrid):
            dots = find_dots(picture.grey, gates.smallest_dot_px)
            yield dot_grid_points(picture, board, dots, gates)
        elif isinstance(board, AprilGrid):
            seen = sight.markers(board.dictionary, carriers, board.border_modules)
            markers, doubles = once(seen)
            found = april_grid_points(picture, board, markers, gates)
            yield found[0], found[1] + doubles


def _unique(points: Sequence[Point]) -> tuple[list[Point], list[Rejection]]:
    """Points whose target was found once; targets found twice are not used at all."""
    counts = Counter(p.target for p in points)
    doubles = [
        Rejection(p.target, Rule.UNIQUE_ID, float(counts[p.target]), 1.0, p.pixel)
        for p in points
        if counts[p.target] > 1
    ]
    return [p for p in points if counts[p.target] == 1], doubles


def _detections(
    plan: TargetPlan,
    picture: Picture,
    points: Sequence[Point],
    rejections: Sequence[Rejection],
    findings: Sequence[PictureProblem],
) -> Detections:
    order = {name: k for k, name in enumerate(plan.target_set().ids)}
    points = sorted(points, key=lambda p: order[p.target])
    return Detections(
        picture.size_px,
        tuple(p.target for p in points),
        np.reshape([p.pixel for p in points], (-1, 2)),
        np.reshape([p.sigma_px for p in points], (-1, 2)),
        np.array([p.blur_px for p in points], dtype=np.float64),
        tuple(rejections),
        tuple(findings),
    )
