"""How the views of a rig lie on a sheet: third-angle projection at the largest scale that fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from rig.build.drawings.frame import A3_LANDSCAPE_MM, BLOCK_MM, MARGIN_MM
from rig.build.mounts.structure import Structure

DENOMINATORS = (1, 2, 2.5, 5, 7.5, 10, 12.5, 15, 20, 25, 30, 40, 50, 75, 100, 150, 200, 500, 1000)
EDGE_MM = 24.0
"""Room at the outer sides of the views, for ordinates."""

BETWEEN_MM = 36.0


@dataclass(frozen=True)
class SheetView:
    """How the rig is looked at: axes to the right, up and towards the viewer, in the rig."""

    title: str
    right: tuple[float, float, float]
    up: tuple[float, float, float]

    @property
    def axes(self) -> Floats:
        """Rows right, up and towards the viewer, (3, 3)."""
        return np.array([self.right, self.up, np.cross(self.right, self.up)])


FRONT = SheetView("Front: from behind the cameras", (1, 0, 0), (0, 0, 1))
TOP = SheetView("Top", (1, 0, 0), (0, 1, 0))
SIDE = SheetView("Right side", (0, 1, 0), (0, 0, 1))
BEHIND = (FRONT, TOP, SIDE)
BEFORE = (
    SheetView("Front: from the subject's side", (-1, 0, 0), (0, 0, 1)),
    SheetView("Top", (-1, 0, 0), (0, -1, 0)),
    SheetView("Right side", (0, -1, 0), (0, 0, 1)),
)
"""A plate would hide what is on it from behind, and is drilled and set from this side."""


def views_of(structure: Structure) -> tuple[SheetView, SheetView, SheetView]:
    """Front, top and right side of a mount, its front the side that whoever sets it sees."""
    return BEFORE if structure.plates else BEHIND


@dataclass(frozen=True, eq=False)
class PlacedView:
    """A view on the paper: paper = ``origin_mm`` + (in the view - ``low_mm``) / denominator."""

    view: SheetView
    low_mm: Floats
    high_mm: Floats
    origin_mm: Floats
    denominator: float

    def paper(self, points_rig_mm: Floats) -> Floats:
        """Points (N, 3) of the rig on the paper, (N, 2)."""
        return self.flat(np.asarray(points_rig_mm) @ self.view.axes[:2].T)

    def flat(self, points_view_mm: Floats) -> Floats:
        """Points (..., 2) of the view on the paper."""
        return np.asarray((points_view_mm - self.low_mm) / self.denominator + self.origin_mm)

    @property
    def size_mm(self) -> Floats:
        """Width and height on the paper, (2,)."""
        return np.asarray((self.high_mm - self.low_mm) / self.denominator)


def arranged(
    low: Floats, high: Floats, views: tuple[SheetView, SheetView, SheetView] = BEHIND
) -> tuple[PlacedView, PlacedView, PlacedView]:
    """Front, top above it and side right of it, at the largest scale that fits.

    ``low``, ``high`` (3,): corners of what is drawn, in the rig frame.
    """
    width, depth, height = high - low
    across = A3_LANDSCAPE_MM[0] - 2.0 * MARGIN_MM - 2.0 * EDGE_MM - BETWEEN_MM
    upwards = A3_LANDSCAPE_MM[1] - 2.0 * MARGIN_MM - BLOCK_MM[1] - 2.0 * EDGE_MM - BETWEEN_MM - 6.0
    for n in DENOMINATORS:
        if (width + depth) / n <= across and (height + depth) / n <= upwards:
            break
    else:
        raise InputError(
            "drawing-size", "the rig is too large for a drawing", "check the plan's positions"
        )
    left = MARGIN_MM + EDGE_MM + (across - (width + depth) / n) / 2.0
    base = MARGIN_MM + BLOCK_MM[1] + EDGE_MM + (upwards - (height + depth) / n) / 2.0
    origins = (
        (left, base),
        (left, base + height / n + BETWEEN_MM),
        (left + width / n + BETWEEN_MM, base),
    )
    front, top, side = (
        PlacedView(view, *_ends(view, low, high), np.array(origin), float(n))
        for view, origin in zip(views, origins, strict=True)
    )
    return front, top, side


def _ends(view: SheetView, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    ends = np.stack([low, high]) @ view.axes[:2].T
    return ends.min(axis=0), ends.max(axis=0)
