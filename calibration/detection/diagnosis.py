"""Why a picture shows none of the targets it should: the usual reasons, tried one by one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from calibration.detection import opencv
from calibration.detection.boarddiagnosis import (
    chessboard_layout,
    corner_squares,
    grid_layout,
)
from calibration.detection.detections import PictureProblem
from calibration.detection.exposure import unreadable
from calibration.detection.gates import Gates
from calibration.detection.images import Picture
from calibration.detection.opencv import Markers
from calibration.detection.plates import (
    LAYOUT_AGREEMENT,
    agreeing,
    believable,
    marker_share,
    plane_markers,
)
from calibration.detection.rings import mirrored_codes, ring_dots
from calibration.detection.seeing import MarkerSearch
from calibration.targets.boards import MOST_SQUARES, AprilGrid, Chessboard
from calibration.targets.kinds import (
    CarrierKind,
    CharucoPlate,
    MarkerCarrier,
    RingCarrier,
    TargetPlan,
    marker_numbers,
)

_ENOUGH_MARKERS = 4
_MOST_COLUMNS = 30
_BACK = "; or, where it is the back of a plate, give back_mm, the plate's thickness"
_SIZE_SHARE, _SIZE_PX = 0.05, 3.0
MIRRORED_SHARE = 0.05
"""Share of a set's codes that a mirror must show, and four of them, or a third of a small set's: a
few are read by chance."""

_Question = Callable[[Mapping[bool, MarkerSearch], TargetPlan, Gates, int], PictureProblem | None]

FEW = 8
"""Some codes look the same in a mirror: a few targets can be found in a mirrored picture."""


def diagnose(
    sights: Mapping[bool, MarkerSearch], plan: TargetPlan, gates: Gates, found: int
) -> tuple[PictureProblem, ...]:
    """What explains that a plate, or all targets, are missing; empty when nothing does.

    ``sights`` are the picture, and its negative for targets with black and white exchanged;
    ``found`` is how many targets were found. Plates whose markers lie otherwise than they should
    are reported in any case; the slower questions are asked only when nothing was found.
    """
    findings = [
        finding
        for plate in plan.carriers
        if isinstance(plate, CharucoPlate)
        and (finding := plate_layout(sights[plate.inverted], plate)) is not None
    ]
    findings += [
        finding
        for grid in plan.carriers
        if isinstance(grid, AprilGrid)
        and (finding := grid_layout(sights[grid.inverted], grid)) is not None
    ]
    if findings or found > FEW:
        return tuple(findings)
    if found:
        questions: tuple[_Question, ...] = (_mirrored,)
    else:
        questions = (_mirrored, _boards, _inverted, _other_dictionary, _light)
    for question in questions:
        answer = question(sights, plan, gates, found)
        if answer is not None:
            return (answer,)
    return ()


def plate_layout(sight: MarkerSearch, plate: CharucoPlate) -> PictureProblem | None:
    """Whether the markers seen lie as on another plate than the one described."""
    markers = sight.markers(plate.dictionary, (plate,))
    own, _ = plane_markers(plate, markers)
    if len(own) < _ENOUGH_MARKERS:
        return None
    return _marker_size(plate, own) if believable(plate, markers) else other_layout(plate, markers)


def _marker_size(plate: CharucoPlate, own: Markers) -> PictureProblem | None:
    """Whether markers are of another size for their squares than described."""
    share = marker_share(plate, own)
    told = plate.marker_mm / plate.square_mm
    side = np.linalg.norm(own.corners_px - np.roll(own.corners_px, 1, axis=1), axis=2)
    # Corners as first found are about a pixel inside, and the lens bends the plane.
    room = _SIZE_SHARE + _SIZE_PX / float(np.median(side))
    if share is None or abs(share / told - 1.0) < room:
        return None
    return PictureProblem(
        "marker-size",
        f"the markers of plate {plate.name!r} are about {share:.2f} of a square, marker_mm = "
        f"{plate.marker_mm:g} and square_mm = {plate.square_mm:g} say {told:.2f}",
        "measure both on the plate and correct them in the target file",
    )


def other_layout(plate: CharucoPlate, markers: Markers) -> PictureProblem:
    """The plate that fits the markers best, in words."""
    best, share = None, LAYOUT_AGREEMENT
    for columns in sorted(range(3, _MOST_COLUMNS), key=lambda c: c != plate.rows):
        for legacy in (plate.legacy, not plate.legacy):
            trial = _variant(plate, columns, legacy)
            if trial is None:
                continue
            own, _ = plane_markers(trial, markers)
            agreement = float(agreeing(trial, markers).mean()) if len(own) else 0.0
            if len(own) >= _ENOUGH_MARKERS and agreement > share:
                best, share = trial, agreement
    name = plate.name
    if best is None:
        return PictureProblem(
            "other-board",
            f"the markers of plate {name!r} do not lie as on a plate of {plate.columns} columns",
            "check columns, rows and dictionary in the target file against the printed plate",
        )
    if best.columns == plate.columns:
        return PictureProblem(
            "legacy",
            f"plate {name!r} is printed in the {'legacy' if best.legacy else 'present'} pattern",
            f"set legacy = {str(best.legacy).lower()} in the target file",
        )
    if best.columns == plate.rows:
        return PictureProblem(
            "swapped",
            f"plate {name!r} has {plate.rows} columns and {plate.columns} rows, not "
            f"{plate.columns} columns and {plate.rows} rows",
            "exchange columns and rows in the target file",
        )
    return PictureProblem(
        "other-board",
        f"plate {name!r} has {best.columns} columns, not {plate.columns}",
        "correct columns and rows in the target file, or use the right plate",
    )


def _variant(plate: CharucoPlate, columns: int, legacy: bool) -> CharucoPlate | None:
    """A plate of other columns with rows enough for all markers, first square white or black.

    Only the parity of the rows matters to where a legacy pattern begins; even is taken. None for
    plates longer than any: so many markers on so few columns.
    """
    rows = plate.columns if columns == plate.rows else plate.rows
    rows = max(rows, -(-2 * (plate.columns * plate.rows) // columns) // 2)
    if columns not in (plate.columns, plate.rows) or (legacy and rows % 2):
        rows += rows % 2
    if rows > MOST_SQUARES:
        return None
    return CharucoPlate(
        plate.name,
        columns,
        max(rows, 3),
        plate.square_mm,
        plate.marker_mm,
        plate.dictionary,
        plate.first_marker,
        legacy,
    )


def _boards(
    sights: Mapping[bool, MarkerSearch], plan: TargetPlan, gates: Gates, found: int
) -> PictureProblem | None:
    del gates, found
    for board in plan.carriers:
        if isinstance(board, Chessboard):
            finding = chessboard_layout(sights[board.inverted], board)
            if finding is not None:
                return finding
    return corner_squares(sights, plan)


def _mirrored(
    sights: Mapping[bool, MarkerSearch], plan: TargetPlan, gates: Gates, found: int
) -> PictureProblem | None:
    rings = [c for c in plan.carriers if isinstance(c, RingCarrier)]
    # The back of a plate that has one is meant to be seen in a mirror.
    one_sided = [c for c in plan.carriers if not isinstance(c, CharucoPlate) or c.back_mm is None]
    count = 0
    for inverted, sight in sights.items():
        side = sight.picture
        count += _known_markers(side.mirrored, one_sided, inverted)
        mine = [c for c in rings if c.inverted == inverted]
        count += mirrored_codes(side, ring_dots(side, gates), mine) if mine else 0
    codes = sum(len(marker_numbers(c)) for c in one_sided) + sum(len(c.ids) for c in rings)
    by_chance = max(min(_ENOUGH_MARKERS, codes / 3.0), MIRRORED_SHARE * codes)
    if count < max(2.0, by_chance, 0.5 * found):
        return None
    return PictureProblem(
        "mirrored",
        f"the picture is mirrored: {count} targets can be read in a mirror only",
        "switch off mirroring or flipping in the camera or its viewer, and take it again"
        + (_BACK if any(isinstance(c, CharucoPlate) for c in one_sided) else ""),
    )


def _inverted(
    sights: Mapping[bool, MarkerSearch], plan: TargetPlan, gates: Gates, found: int
) -> PictureProblem | None:
    del gates, found
    for inverted, sight in sights.items():
        side = sight.picture.negative
        if _known_markers(side, plan.carriers, inverted) >= 2:
            return PictureProblem(
                "inverted",
                "the targets are printed with black and white exchanged",
                f"set inverted = {str(not inverted).lower()} in the target file",
            )
    return None


def _light(
    sights: Mapping[bool, MarkerSearch], plan: TargetPlan, gates: Gates, found: int
) -> PictureProblem | None:
    del plan, gates, found
    inverted, sight = next(iter(sights.items()))
    return unreadable(sight.picture.negative if inverted else sight.picture)


def _known_markers(picture: Picture, carriers: Sequence[CarrierKind], inverted: bool) -> int:
    count = 0
    wanted = {
        (dictionary, c.border_modules if isinstance(c, AprilGrid) else 1, number)
        for c in carriers
        if c.inverted == inverted
        for dictionary, number in marker_numbers(c)
    }
    for dictionary, border in sorted({(name, border) for name, border, _ in wanted}):
        found = opencv.detect_markers(picture.grey, dictionary, border_modules=border)
        count += sum((dictionary, border, n) in wanted for n in found.ids.tolist())
    return count


def _other_dictionary(
    sights: Mapping[bool, MarkerSearch], plan: TargetPlan, gates: Gates, found: int
) -> PictureProblem | None:
    del gates, found
    carriers = [c for c in plan.carriers if isinstance(c, CharucoPlate | AprilGrid | MarkerCarrier)]
    if not carriers:
        return None
    mine = sorted({c.dictionary for c in carriers})
    picture = sights[carriers[0].inverted].picture
    counts = {
        name: len(opencv.detect_markers(picture.grey, name))
        for name in opencv.dictionary_names()
        if name not in mine
    }
    name = max(counts, key=lambda n: (counts[n], -opencv.dictionary_size(n)))
    # Small dictionaries are the beginnings of larger ones: their own markers are read in both.
    own = sum(_known_markers(sight.picture, carriers, side) for side, sight in sights.items())
    if counts[name] < max(_ENOUGH_MARKERS, 2 * own):
        return None
    return PictureProblem(
        "dictionary",
        f"the picture shows {counts[name]} markers of {name}, none of {', '.join(mine)}",
        "give the target file of the targets in the picture",
    )
