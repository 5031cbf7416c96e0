"""Why a board of others is not found: the usual mistakes in its description, tried one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from calibration.detection import opencv
from calibration.detection.boards import grid_tags, tag_scales, tags_agree
from calibration.detection.detections import PictureProblem
from calibration.detection.opencv import Markers
from calibration.detection.seeing import MarkerSearch
from calibration.targets.boards import AprilGrid, Chessboard
from calibration.targets.kinds import MarkerCarrier, TargetPlan

_ENOUGH_TAGS = 4
_SHARE = 0.7
_AS_TOLD = 0.05
_MOST_COLUMNS = 30
_LARGE_PX = 1600
_TURNS: tuple[Literal[0, 90, 180, 270], ...] = (0, 90, 180, 270)


def grid_layout(sight: MarkerSearch, grid: AprilGrid) -> PictureProblem | None:
    """Whether the tags seen are another AprilGrid than the one described."""
    other: Literal[1, 2] = 1 if grid.border_modules == 2 else 2
    tags = sight.markers(grid.dictionary, (grid,), grid.border_modules)
    if _own(grid, tags) < _ENOUGH_TAGS:
        tags = sight.markers(grid.dictionary, (grid,), other)
        if _own(grid, tags) < _ENOUGH_TAGS:
            return None
        return PictureProblem(
            "border",
            f"the tags of {grid.name!r} have a black border of {other} modules, not "
            f"{grid.border_modules}",
            f"set border_modules = {other} in the target file",
        )
    if _agreement(grid, tags) > _SHARE:
        return None
    gap = _gap(grid, tags)
    if gap is not None:
        return gap
    for variant in _variants(grid):
        if _agreement(variant, tags) > _SHARE:
            return _difference(grid, variant)
    return PictureProblem(
        "other-board",
        f"the tags of {grid.name!r} do not lie as on a grid of {grid.columns} columns",
        "check columns, rows, gap_mm and first_tag in the target file against the board",
    )


def _own(grid: AprilGrid, tags: Markers) -> int:
    return len(grid_tags(grid, tags)[0])


def _agreement(grid: AprilGrid, tags: Markers) -> float:
    own, numbers = grid_tags(grid, tags)
    return float(tags_agree(grid, own, numbers).mean()) if len(own) >= _ENOUGH_TAGS else 0.0


def _variants(grid: AprilGrid) -> Iterator[AprilGrid]:
    """Grids described otherwise, the likelier mistakes first."""
    for turn in _TURNS:
        yield replace(grid, tag_turn_deg=turn)
    yield replace(grid, from_top=not grid.from_top)
    for turn in _TURNS:
        yield replace(grid, tag_turn_deg=turn, from_top=not grid.from_top)
    tags = grid.columns * grid.rows
    for columns in sorted(range(1, _MOST_COLUMNS), key=lambda c: c != grid.rows):
        yield replace(grid, columns=columns, rows=max(2, -(-tags // columns)))


def _difference(grid: AprilGrid, found: AprilGrid) -> PictureProblem:
    name = grid.name
    if found.columns != grid.columns:
        return PictureProblem(
            "other-board",
            f"AprilGrid {name!r} has {found.columns} columns, not {grid.columns}",
            "correct columns and rows in the target file, or use the right board",
        )
    keys = [
        f"{key} = {str(getattr(found, key)).lower()}"
        for key in ("tag_turn_deg", "from_top")
        if getattr(found, key) != getattr(grid, key)
    ]
    return PictureProblem(
        "tag-order",
        f"the tags of AprilGrid {name!r} are turned or numbered otherwise than described",
        f"set {' and '.join(keys)} in the target file",
    )


def _gap(grid: AprilGrid, tags: Markers) -> PictureProblem | None:
    """Tags of another size for their distance, all alike and none turned."""
    own, numbers = grid_tags(grid, tags)
    scales = tag_scales(grid, own, numbers)
    if len(scales) < _ENOUGH_TAGS or np.ptp(scales) > 0.3 * abs(np.median(scales)):
        return None
    scale = float(np.median(scales))
    share = grid.pitch_mm / (grid.tag_mm * scale) - 1.0
    if abs(scale - 1.0) < _AS_TOLD or not 0.02 < share < 1.0:
        return None
    return PictureProblem(
        "gap",
        f"the gaps of AprilGrid {grid.name!r} are {'narrower' if scale > 1.0 else 'wider'} against "
        f"its tags than gap_mm = {grid.gap_mm:g} and tag_mm = {grid.tag_mm:g} say",
        "measure both and correct tag_mm and gap_mm: Kalibr's tagSpacing is gap over tag",
    )


def chessboard_layout(sight: MarkerSearch, board: Chessboard) -> PictureProblem | None:
    """Whether a picture shows a chessboard of another size."""
    grey = sight.picture.grey
    factor = -(-max(grey.shape) // _LARGE_PX)
    size = opencv.chessboard_size(opencv.reduced(grey, factor) if factor > 1 else grey)
    if size is None or sorted(size) == sorted((board.columns, board.rows)):
        return None
    across, down = sorted(size, reverse=board.columns >= board.rows)
    return PictureProblem(
        "chessboard-size",
        f"the picture shows a chessboard of {across} x {down} squares ({across - 1} x {down - 1} "
        f"inner corners), not of {board.columns} x {board.rows} squares",
        "count squares, not inner corners, and correct columns and rows in the target file",
    )


def corner_squares(sights: Mapping[bool, MarkerSearch], plan: TargetPlan) -> PictureProblem | None:
    """Whether markers have black squares at their corners, as an AprilGrid has."""
    for carrier in plan.carriers:
        if not isinstance(carrier, MarkerCarrier):
            continue
        sight = sights[carrier.inverted]
        corners = sight.markers(carrier.dictionary, (carrier,)).corners_px
        if len(corners) < _ENOUGH_TAGS:
            corners = sight.markers(carrier.dictionary, (carrier,), 2).corners_px
        if len(corners) < _ENOUGH_TAGS:
            continue
        middle = corners.mean(axis=1, keepdims=True)
        sides = (corners + np.roll(corners, 1, axis=1)) / 2.0
        grey = sight.picture.grey
        beyond, inside, beside = (
            opencv.sampled(grey, middle + share * (at - middle))
            for share, at in ((1.18, corners), (0.93, corners), (1.18, sides))
        )
        if np.median(beyond - inside) < 0.3 * np.median(beside - inside):
            return PictureProblem(
                "corner-squares",
                f"the markers of {carrier.name!r} have black squares at their corners, as the tags "
                "of an AprilGrid have",
                "describe them as [[aprilgrids]] in the target file",
            )
    return None
