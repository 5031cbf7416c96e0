"""Room for screw heads and nuts, from the catalogue or from the usual proportions."""

from __future__ import annotations

import re
from dataclasses import dataclass

from common.errors import InputError
from rig.catalogue.catalogue import Catalogue

HEAD_SHARE = 1.5
"""Head of a socket cap screw over its thread's diameter: exact for inch sizes (ASME B18.3)."""

FLATS_SHARE = 1.75
"""Width across flats of a hexagon nut over its thread's diameter (1/4-20: 11.1 of 6.35 mm)."""

INCH_MM = 25.4


@dataclass(frozen=True)
class Room:
    """What a screw of one thread needs, in millimetres."""

    diameter_mm: float
    head_diameter_mm: float
    across_flats_mm: float
    nut_height_mm: float


def room_for(screw: str, catalogue: Catalogue) -> Room:
    """Room for a screw named by catalogue entry or thread (``M5``, ``1/4-20``)."""
    entry = catalogue.fasteners.get(screw)
    thread = entry.thread if entry is not None else screw
    diameter = _diameter_mm(thread)
    parts = [f for f in catalogue.fasteners.values() if f.thread == thread]
    head = next((f.head_diameter_mm for f in parts if f.head_diameter_mm), HEAD_SHARE * diameter)
    nut = next((f for f in parts if f.kind == "hex-nut"), None)
    flats = nut.across_flats_mm if nut is not None else None
    height = nut.head_height_mm if nut is not None else None
    return Room(diameter, head, flats or FLATS_SHARE * diameter, height or diameter)


def _diameter_mm(thread: str) -> float:
    """Nominal diameter of a thread by its name."""
    metric = re.fullmatch(r"M(\d+(?:\.\d+)?)(?:x.*)?", thread)
    if metric:
        return float(metric[1])
    inch = re.fullmatch(r"(\d+)/(\d+)-\d+(?: UN[CF])?", thread)
    if inch and int(inch[2]):
        return INCH_MM * int(inch[1]) / int(inch[2])
    raise InputError("thread", f"no thread is called {thread!r}", "write it as M5 or 1/4-20")
