"""Carriers as pictures, for the simulated studio: what a print looks like from in front.

White paper reflects 86 % and black ink 4 %; shares in between, at edges, are of light, and the
picture is coded with the sRGB curve, as the studio reads pictures.
"""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.targets.boardpatterns import board_pattern
from calibration.targets.boards import Board
from calibration.targets.kinds import CarrierKind, CharucoPlate, MarkerCarrier
from calibration.targets.patterns import Pattern, marker_pattern, plate_pattern, ring_pattern
from common.errors import InputError
from geometry.arrays import Floats

PX_PER_MM = 12.0
MOST_PIXELS = 20_000_000
"""An A3 sheet. Half a gigabyte while it is drawn."""

WHITE, BLACK = 0.86, 0.04
WIDTH_KEY = "rigwright-width-mm"
"""Text of a face's PNG: the width of the whole picture, white border included."""

FLAT_MM = 1e-6


@dataclass(frozen=True, eq=False)
class Face:
    """A carrier's face: ``png`` and the width and height that it stands for."""

    png: bytes
    width_mm: float
    height_mm: float


def carrier_face(kind: CarrierKind, px_per_mm: float = PX_PER_MM) -> Face:
    """The face of a flat carrier whose targets have places, at its nominal size.

    A large one gets fewer pixels per millimetre. Raises a one-line :class:`InputError` for a
    carrier that has no face, see :func:`has_face`.
    """
    if not has_face(kind):
        raise InputError(
            "face-flat",
            f"carrier {kind.name!r} is not flat, or its targets have no places",
            "only sheets have a picture",
        )
    patterns = _placed(kind)
    corners = np.array([_extent(pattern, place) for pattern, place in patterns])
    low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    px_per_mm = min(px_per_mm, float(np.sqrt(MOST_PIXELS / np.prod(high - low))))
    width, height = (int(np.ceil(side * px_per_mm)) for side in high - low)
    box = 1.0 / px_per_mm
    white = np.ones((height, width))
    for pattern, place in patterns:
        _paint(white, pattern, place - low, box)
    light = BLACK + (WHITE - BLACK) * np.clip(white, 0.0, 1.0)
    return Face(
        _png(np.round(255.0 * _srgb(light)).astype(np.uint8), box), width * box, height * box
    )


def _png(grey: NDArray[np.uint8], box_mm: float) -> bytes:
    """A PNG that says how wide it is meant to be: who places it need not guess."""
    # Imported late: only pictures of targets need it.
    from PIL import Image, PngImagePlugin

    told = PngImagePlugin.PngInfo()
    told.add_text(WIDTH_KEY, f"{grey.shape[1] * box_mm:.4f}")
    file = io.BytesIO()
    dots_per_inch = 25.4 / box_mm
    Image.fromarray(grey).save(file, "PNG", pnginfo=told, dpi=(dots_per_inch, dots_per_inch))
    return file.getvalue()


def has_face(kind: CarrierKind) -> bool:
    """Whether a carrier is flat and its targets have places."""
    if isinstance(kind, CharucoPlate | Board):
        return True
    places = np.array([p.position_mm for p in kind.places])
    return bool(np.isfinite(places).all() and np.ptp(places[:, 2]) <= FLAT_MM)


def _placed(kind: CarrierKind) -> list[tuple[Pattern, Floats]]:
    """Each pattern of a carrier with its place in the carrier's plane."""
    if isinstance(kind, CharucoPlate):
        return [(plate_pattern(kind), np.zeros(2))]
    if isinstance(kind, Board):
        return [(board_pattern(kind), np.zeros(2))]
    places = np.array([p.position_mm for p in kind.places])
    if isinstance(kind, MarkerCarrier):
        made: list[Pattern] = [marker_pattern(kind, p.number) for p in kind.places]
    else:
        made = [ring_pattern(kind, p.number) for p in kind.places]
    return [(pattern, place[:2]) for pattern, place in zip(made, places, strict=True)]


def _extent(pattern: Pattern, place: Floats) -> Floats:
    left, top, right, bottom = pattern.extent_mm
    return np.array([[left, top], [right, bottom]]) + place


def _paint(white: Floats, pattern: Pattern, place_mm: Floats, box_mm: float) -> None:
    """Put a pattern at a place, measured from the face's first pixel's outer corner."""
    low, high = _extent(pattern, place_mm) / box_mm
    first = np.maximum(np.floor(low).astype(int), 0)
    last = np.minimum(np.ceil(high).astype(int), np.array(white.shape)[::-1])
    columns, rows = np.arange(first[0], last[0]), np.arange(first[1], last[1])
    x, y = np.meshgrid((columns + 0.5) * box_mm - place_mm[0], (rows + 0.5) * box_mm - place_mm[1])
    share = pattern.white_share(x, y, (box_mm, box_mm))
    at = slice(first[1], last[1]), slice(first[0], last[0])
    # Clear spaces of neighbours may overlap; ink never does.
    white[at] = np.minimum(white[at], share)


def _srgb(light: Floats) -> Floats:
    """Codes of the sRGB curve (IEC 61966-2-1), 0 to 1, of shares of light."""
    high = 1.055 * np.maximum(light, 0.0) ** (1.0 / 2.4) - 0.055
    return np.asarray(np.where(light <= 0.0031308, 12.92 * light, high))
