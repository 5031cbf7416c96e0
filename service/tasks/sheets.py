"""What is made of a target set: sheets to print, pictures for the simulated studio."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from calibration.targets.boards import Board
from calibration.targets.drawing import Drawing
from calibration.targets.faces import carrier_face, has_face
from calibration.targets.kinds import (
    CarrierKind,
    CharucoPlate,
    TargetPlace,
    TargetPlan,
)
from calibration.targets.printing import carrier_drawings, to_pdf, to_svg
from common.errors import InputError
from service.kinds.defaults import PAGE
from service.store.scans import plain_name

PLACE_FIELDS = ("number", "x_rig_mm", "y_rig_mm", "z_rig_mm")
PUT_UP = "Cut the targets out with their white, and stick each to the stand at its place in {}."


@dataclass(frozen=True)
class Sheet:
    """One file made of a carrier; ``make`` makes it."""

    name: str
    carrier: str
    media_type: str
    make: Callable[[], bytes]


def sheets_of(plan: TargetPlan, page: str = PAGE) -> Mapping[str, Sheet]:
    """By file name: a PDF of each carrier, an SVG of each of its pages, a picture if it is flat.

    Raises :class:`InputError` for a carrier that does not fit its page.
    """
    sheets: list[Sheet] = []
    for carrier in plan.carriers:
        sheets += _printed(carrier, page)
        sheets += _pictured(carrier)
        sheets += _placed(carrier)
    return {sheet.name: sheet for sheet in sheets}


def _printed(carrier: CarrierKind, page: str) -> list[Sheet]:
    stem = _stem(carrier)
    todo = PUT_UP.format(f"{stem}-places.csv") if _stands_apart(carrier) else ""
    drawings = _drawn(_laid_out(carrier), page, todo)
    many = len(drawings) > 1
    svgs = [
        Sheet(
            f"{stem}-{number}.svg" if many else f"{stem}.svg",
            carrier.name,
            "image/svg+xml",
            lambda drawing=drawing: to_svg(drawing).encode(),  # type: ignore[misc]
        )
        for number, drawing in enumerate(drawings, 1)
    ]
    pdf = Sheet(
        f"{stem}.pdf", carrier.name, "application/pdf", lambda: to_pdf(drawings, carrier.name)
    )
    return [pdf, *svgs]


def _drawn(carrier: CarrierKind, page: str, todo: str) -> tuple[Drawing, ...]:
    """The pages of a carrier, turned where it does not fit upright."""
    try:
        return carrier_drawings(carrier, page, todo)
    except InputError as error:
        if error.detail != "print-page" or page.endswith("landscape"):
            raise
    return carrier_drawings(carrier, f"{page} landscape", todo)


def _laid_out(carrier: CarrierKind) -> CarrierKind:
    """A stand's targets one beside the other: they are cut out and put up at their places."""
    if isinstance(carrier, CharucoPlate | Board) or not _stands_apart(carrier):
        return carrier
    return replace(carrier, places=tuple(TargetPlace(place.number) for place in carrier.places))


def _stands_apart(carrier: CarrierKind) -> bool:
    """Whether its targets do not lie in one plane: they are put up one by one."""
    if isinstance(carrier, CharucoPlate | Board):
        return False
    depth = np.array([place.position_mm[2] for place in carrier.places])
    return bool(np.isfinite(depth).all() and np.ptp(depth) > 1e-6)


def _placed(carrier: CarrierKind) -> list[Sheet]:
    """Where the targets of a stand go, as a table."""
    if isinstance(carrier, CharucoPlate | Board) or not _stands_apart(carrier):
        return []
    rows = [(place.number, *(f"{v:.1f}" for v in place.position_mm)) for place in carrier.places]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([PLACE_FIELDS, *rows])
    make = text.getvalue().encode
    return [Sheet(f"{_stem(carrier)}-places.csv", carrier.name, "text/csv", make)]


def _pictured(carrier: CarrierKind) -> list[Sheet]:
    if not has_face(carrier):
        return []
    name = f"{_stem(carrier)}.png"
    return [Sheet(name, carrier.name, "image/png", lambda: carrier_face(carrier).png)]


def _stem(carrier: CarrierKind) -> str:
    return plain_name(f"{carrier.name}.x").removesuffix(".x")
