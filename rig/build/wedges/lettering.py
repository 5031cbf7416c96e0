"""Outlines of words, from the typeface that the PDF library brings along."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Floats

if TYPE_CHECKING:
    from fontTools.ttLib import TTFont

CURVE_STEPS = 4
UNKNOWN = "?"


@dataclass(frozen=True, eq=False)
class Words:
    """``contours`` (each (N, 2)), one unit high capitals, baseline from the origin to ``width``."""

    contours: tuple[Floats, ...]
    width: float


def typeface_file() -> str:
    """Path of the typeface: DejaVu's forerunner Bitstream Vera, as installed with reportlab."""
    from importlib.resources import files

    return str(files("reportlab").joinpath("fonts", "VeraBd.ttf"))


@lru_cache(maxsize=1)
def _typeface() -> TTFont:
    from fontTools.ttLib import TTFont

    return TTFont(typeface_file())


@lru_cache(maxsize=512)
def _glyph(letter: str) -> tuple[tuple[Floats, ...], float]:
    """Contours and advance of one letter in font units."""
    from fontTools.pens.recordingPen import DecomposingRecordingPen

    font = _typeface()
    names, glyphs = font.getBestCmap(), font.getGlyphSet()
    name = names.get(ord(letter)) or names[ord(UNKNOWN)]
    pen = DecomposingRecordingPen(glyphs)
    glyphs[name].draw(pen)
    contours: list[list[Floats]] = []
    for what, places in pen.value:
        points = [np.array(p, dtype=np.float64) for p in places if p is not None]
        if what == "moveTo":
            contours.append([points[0]])
        elif what == "lineTo":
            contours[-1].append(points[0])
        elif what == "qCurveTo":
            contours[-1].extend(_curve(contours[-1][-1], points))
    return tuple(np.array(c) for c in contours if len(c) > 2), float(glyphs[name].width)


def _curve(start: Floats, points: list[Floats]) -> list[Floats]:
    """A TrueType run of quadratic curves as points; ends between handles are implied."""
    out: list[Floats] = []
    for k, handle in enumerate(points[:-1]):
        last = k == len(points) - 2
        end = points[-1] if last else (handle + points[k + 1]) / 2.0
        shares = np.linspace(0.0, 1.0, CURVE_STEPS + 1)[1:]
        out += [(1 - t) ** 2 * start + 2 * t * (1 - t) * handle + t**2 * end for t in shares]
        start = end
    return out


def words(text: str) -> Words:
    """Outlines of a line of text; letters that the typeface lacks become a question mark."""
    capital = float(max(c[:, 1].max() for c in _glyph("H")[0]))
    contours, pen = [], 0.0
    for letter in text:
        shapes, advance = _glyph(letter)
        contours += [(shape + np.array([pen, 0.0])) / capital for shape in shapes]
        pen += advance
    return Words(tuple(contours), pen / capital)
