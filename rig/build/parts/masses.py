"""What small parts weigh of which nobody publishes it: steel, by the sizes of their standards."""

from __future__ import annotations

import math

from rig.catalogue import Catalogue
from rig.catalogue.items import Fastener

STEEL_G_PER_MM3 = 7.85e-3
PITCH_DEPTH = 0.6495
"""From the nominal to the pitch diameter in pitches, ISO 724: a thread holds as much metal as a
rod of its pitch diameter, for its crests fill its roots."""

SOCKET_DEPTH = 0.5
"""Depth of a cap screw's socket in diameters, ISO 4762: 1.3 of M3, 4 of M8."""

NUT_WIDTH, NUT_HEIGHT = 1.6, 0.8
"""Width across flats and height of a hexagon nut in diameters, near those of ISO 4032."""

HEXAGON = math.sqrt(3.0) / 2.0
"""Area of a hexagon over the square of its width across flats."""


def small_part_g(wanted: str, length_mm: float | None, catalogue: Catalogue) -> float | None:
    """Mass of a part in g: published, else of a screw, stud or nut computed; None for others.

    ``length_mm`` of a screw or stud under its head; without it its mass is not known. A T-nut is
    taken as a hexagon nut of its thread, which is what holds the same screw.
    """
    part = catalogue.find(wanted)[1]
    published: float | None = getattr(part, "mass_g", None)
    if published is not None or not isinstance(part, Fastener):
        return published
    like = _sized(part, catalogue)
    if like is None or like.diameter_mm is None or like.pitch_mm is None:
        return None
    rod_mm2 = _disk_mm2(like.diameter_mm - PITCH_DEPTH * like.pitch_mm)
    if "nut" in part.kind:
        width = part.across_flats_mm or NUT_WIDTH * like.diameter_mm
        height = part.head_height_mm or NUT_HEIGHT * like.diameter_mm
        return STEEL_G_PER_MM3 * height * (HEXAGON * width**2 - rod_mm2)
    if length_mm is None or part.kind not in ("cap-screw", "stud"):
        return None
    return STEEL_G_PER_MM3 * (rod_mm2 * length_mm + _head_mm3(part))


def _sized(part: Fastener, catalogue: Catalogue) -> Fastener | None:
    """The part itself, or one of the same thread whose sizes are known."""
    if part.diameter_mm is not None:
        return part
    return next(
        (p for p in catalogue.fasteners.values() if p.thread == part.thread and p.diameter_mm), None
    )


def _head_mm3(screw: Fastener) -> float:
    """Head of a cap screw less its socket; nothing for a stud."""
    if not (screw.head_diameter_mm and screw.head_height_mm and screw.key_mm):
        return 0.0
    socket = HEXAGON * screw.key_mm**2 * SOCKET_DEPTH * (screw.diameter_mm or 0.0)
    return _disk_mm2(screw.head_diameter_mm) * screw.head_height_mm - socket


def _disk_mm2(diameter_mm: float) -> float:
    return math.pi / 4.0 * diameter_mm**2
