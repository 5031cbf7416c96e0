"""Ordinates at the side of a view, and names beside what they name, kept apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from geometry.arrays import Floats
from rig.build.drawings.items import Item, Line, Text
from rig.build.drawings.pdf import text_width_mm

ORDINATE_TEXT_MM = 1.9
PITCH_MM = 3.0
JOG_MM = 4.0
SAME_MM = 0.15
DISTANCES_MM = (2.5, 4.0, 6.0, 9.0, 13.0, 18.0, 24.0, 30.0)
"""How far from what it names a name may stand."""

FARTHEST_MM = DISTANCES_MM[-1]

Box = tuple[float, float, float, float]
"""Left, low, right, high."""


@dataclass(frozen=True)
class Ordinate:
    """A coordinate to state: where it is on the paper, and in words."""

    place_mm: float
    words: str


def merged(ordinates: Sequence[Ordinate]) -> list[Ordinate]:
    """In order, each place and figure once."""
    out: list[Ordinate] = []
    for one in sorted(ordinates, key=lambda o: (o.place_mm, o.words)):
        if not out or one.place_mm - out[-1].place_mm > SAME_MM or one.words != out[-1].words:
            out.append(one)
    return out


def spread(places: Floats, pitch_mm: float) -> Floats:
    """Places at least ``pitch_mm`` apart, in the same order and as near as they can be (N,)."""
    from scipy.optimize import isotonic_regression

    if not len(places):
        return places
    comb = pitch_mm * np.arange(len(places))
    return np.asarray(isotonic_regression(places - comb).x + comb)


def ordinate_items(
    ordinates: Sequence[Ordinate], start_mm: float, reach_mm: float, *, upright: bool
) -> list[Item]:
    """Ordinates along the x axis (``upright`` False) or the y axis of the sheet.

    Their lines leave the view at ``start_mm`` and go ``reach_mm`` outwards (its sign says where).
    """
    found = merged(ordinates)
    placed = spread(np.array([o.place_mm for o in found]), PITCH_MM)
    outwards = float(np.sign(reach_mm))
    items: list[Item] = []
    for one, place in zip(found, placed, strict=True):
        stop = start_mm + reach_mm
        run = np.array(
            [
                [one.place_mm, start_mm],
                [one.place_mm, stop - outwards * JOG_MM],
                [place, stop],
            ]
        )
        items.append(Line(run[:, ::-1] if upright else run, "dimension"))
        beside, along = stop + outwards * 0.8, float(place)
        x, y = (beside, along - 0.95) if upright else (along + 0.95, beside)
        anchor = "start" if outwards > 0.0 else "end"
        angle = 0.0 if upright else 90.0
        items.append(Text(one.words, x, y, ORDINATE_TEXT_MM, anchor, angle, "dimension"))
    return items


@dataclass
class Labels:
    """Places names so that none covers another; ``taken`` are boxes (left, low, right, high)."""

    taken: list[Box] = field(default_factory=list)
    lines: list[Floats] = field(default_factory=list)

    def keep_off(self, low: Floats, high: Floats) -> None:
        """Nothing is to be written in this box."""
        self.taken.append((float(low[0]), float(low[1]), float(high[0]), float(high[1])))

    def keep_off_items(self, items: Sequence[Item]) -> None:
        """Nothing is to be written over these texts, nor over these lines where there is room."""
        for item in items:
            if isinstance(item, Text):
                low, high = text_box(item)
                self.keep_off(low, high)
            elif isinstance(item, Line) and len(item.points_mm) > 1:
                self.lines.append(np.stack([item.points_mm[:-1], item.points_mm[1:]], axis=1))

    def place(self, words: str, x: float, y: float, height_mm: float, style: str) -> list[Item]:
        """A name beside a point, with a line to it where it had to go far."""
        width = text_width_mm(words, height_mm)
        drawn = np.concatenate([np.zeros((0, 2, 2)), *self.lines])
        near = np.abs(drawn.mean(axis=1) - (x, y)).max(axis=1)
        near -= np.abs(np.diff(drawn, axis=1)[:, 0]).max(axis=1) / 2.0
        drawn = drawn[near < FARTHEST_MM + width + height_mm]
        for lines in (drawn, drawn[:0]):
            found = self._room((x, y), width, height_mm, lines)
            if found is not None:
                return self._placed(words, (x, y), *found, height_mm, style)
        return self._placed(words, (x, y), (x, y + height_mm), (x, y, x, y), height_mm, style)

    def _room(
        self, point: tuple[float, float], width: float, height_mm: float, lines: Floats
    ) -> tuple[tuple[float, float], Box] | None:
        """The nearest middle beside a point, and its box, that covers no box and no line."""
        x, y = point
        for distance in DISTANCES_MM:
            for angle in np.radians([40, 140, -40, -140, 90, -90, 0, 180, 65, 115, -65, -115]):
                cx = x + (distance + width / 2.0) * np.cos(angle)
                cy = y + (distance + height_mm / 2.0) * np.sin(angle)
                area = (
                    cx - width / 2 - 0.5,
                    cy - height_mm / 2 - 0.5,
                    cx + width / 2 + 0.5,
                    cy + height_mm / 2 + 0.5,
                )
                if not any(_overlap(area, other) for other in self.taken) and not _crossed(
                    area, lines
                ):
                    return (float(cx), float(cy)), area
        return None

    def _placed(
        self,
        words: str,
        point: tuple[float, float],
        centre: tuple[float, float],
        area: Box,
        height_mm: float,
        style: str,
    ) -> list[Item]:
        self.taken.append(area)
        text = Text(words, centre[0], centre[1] - height_mm / 2.0, height_mm, "middle", style=style)
        near = np.clip(point, [area[0], area[1]], [area[2], area[3]])
        if np.linalg.norm(near - point) < 3.0:
            return [text]
        return [text, Line(np.array([point, near]), "thin")]


def text_box(text: Text) -> tuple[Floats, Floats]:
    """Low and high corner (2,) of what a text covers, lying or upright."""
    wide = text_width_mm(text.words, text.height_mm, bold=text.bold)
    start = {"start": 0.0, "middle": -wide / 2.0, "end": -wide}[text.anchor]
    low, high = np.array([start, 0.0]), np.array([start + wide, text.height_mm])
    if text.angle_deg == 90.0:
        low, high = np.array([-high[1], low[0]]), np.array([-low[1], high[0]])
    place = np.array([text.x_mm, text.y_mm])
    return low + place, high + place


def _crossed(area: Box, lines: Floats) -> bool:
    """Whether a line (N, 2, 2) passes through a box or lies in it."""
    first, run = lines[:, 0], lines[:, 1] - lines[:, 0]
    run = np.where(np.abs(run) < 1e-9, 1e-9, run)
    at = np.stack([(np.array(side) - first) / run for side in (area[:2], area[2:])])
    enters, leaves = at.min(axis=0).max(axis=1), at.max(axis=0).min(axis=1)
    return bool((np.maximum(enters, 0.0) <= np.minimum(leaves, 1.0)).any())


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
