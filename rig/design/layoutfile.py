"""The layout as files: JSON for programs, CSV for the workshop."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field, FiniteFloat, ValidationError

from common.errors import InputError
from common.files.reading import plain_bytes
from geometry.arrays import Floats
from rig.design.layout import DATUM_NOTE, Collision, Layout, Neighbour, Placement

SCHEMA = "rigwright.layout/1"

COLUMNS = (
    "name",
    "fixed",
    "across_mm",
    "back_mm",
    "up_mm",
    "pan_deg",
    "tilt_deg",
    "roll_deg",
    "tape_to_lens_mm",
    "focus_mm",
    "mount_x_mm",
    "mount_y_mm",
    "mount_z_mm",
    "nearest_body",
    "body_clearance_mm",
    "nearest_to_view",
    "view_clearance_mm",
)


def rounded(values: Iterable[float], digits: int = 3) -> list[float]:
    """A vector as JSON numbers of ``digits`` decimals: a micrometre, finer than any mount."""
    return [round(float(v), digits) + 0.0 for v in values]


def _neighbour(neighbour: Neighbour | None) -> dict[str, Any] | None:
    if neighbour is None:
        return None
    return {"name": neighbour.name, "clearance_mm": round(neighbour.clearance_mm, 3)}


def _placement(placement: Placement) -> dict[str, Any]:
    pan, tilt, roll = rounded(placement.pan_tilt_roll_deg, 4)
    across, back, up = rounded(placement.from_datum_mm)
    body = placement.camera.camera.body
    return {
        "name": placement.camera.name,
        "fixed": placement.camera.fixed,
        "from_datum": {"across_mm": across, "back_mm": back, "up_mm": up},
        "tape_to_lens_mm": round(placement.tape_mm, 3),
        "pan_deg": pan,
        "tilt_deg": tilt,
        "roll_deg": roll,
        "focus_distance_mm": round(placement.camera.focus_distance_mm, 3),
        "mount": {
            "thread": "1/4-20 UNC",
            "position_mm": rounded(placement.mount_mm),
            "axis_out_of_body": rounded(placement.mount_axis, 6),
        },
        "body": {
            "size_mm": rounded(body.size_mm),
            "corners_mm": [rounded(corner) for corner in placement.body_corners_mm],
        },
        "lens": {
            "diameter_mm": round(body.lens_diameter_mm, 3),
            "length_mm": round(body.lens_length_mm, 3),
            "front_mm": rounded(placement.lens_front_mm),
        },
        "nearest_body": _neighbour(placement.nearest_body),
        "nearest_to_view": _neighbour(placement.nearest_to_view),
    }


def _collision(collision: Collision) -> dict[str, Any]:
    return {
        "kind": collision.kind,
        "name": collision.name,
        "other": collision.other,
        "clearance_mm": round(collision.clearance_mm, 3),
        "required_mm": round(collision.required_mm, 3),
    }


def layout_document(layout: Layout) -> dict[str, Any]:
    """The layout as JSON data; positions are in the rig frame unless they say otherwise."""
    names = [placement.camera.name for placement in layout.placements]
    table = [
        [None if math.isinf(gap) else round(float(gap), 3) for gap in row]
        for row in layout.clearance_mm
    ]
    return {
        "schema": SCHEMA,
        "datum": {"position_mm": rounded(layout.datum_rig_mm), "note": DATUM_NOTE},
        "envelope": {
            "low_mm": rounded(layout.envelope_low_mm),
            "high_mm": rounded(layout.envelope_high_mm),
            "size_mm": rounded(layout.envelope_size_mm),
        },
        "cameras": [_placement(placement) for placement in layout.placements],
        "body_clearance": {"names": names, "clearance_mm": table},
        "collisions": [_collision(collision) for collision in layout.collisions],
    }


class _Datum(BaseModel):
    position_mm: Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]


class _DatumOnly(BaseModel):
    """What is read back of a layout; the rest of it is for others."""

    layout_schema: Annotated[Literal["rigwright.layout/1"], Field(alias="schema")]
    datum: _Datum


def read_datum(path: Path) -> Floats | None:
    """The datum (3,) in the rig frame that a layout file tells; None where there is no such file.

    Raises :class:`InputError` ``layout-file`` for a file that is no layout.
    """
    try:
        read = _DatumOnly.model_validate_json(plain_bytes(path))
    except FileNotFoundError:
        return None
    except (OSError, ValidationError) as error:
        raise InputError(
            "layout-file",
            f"{path.name} beside the design is no layout of a rig ({type(error).__name__})",
            "design the rig again, or take the file away",
        ) from None
    return np.array(read.datum.position_mm, dtype=np.float64)


def _row(placement: Placement) -> list[Any]:
    body, view = placement.nearest_body, placement.nearest_to_view
    return [
        placement.camera.name,
        "yes" if placement.camera.fixed else "no",
        *rounded(placement.from_datum_mm, 2),
        *rounded(placement.pan_tilt_roll_deg, 2),
        round(placement.tape_mm, 2),
        round(placement.camera.focus_distance_mm, 1),
        *rounded(placement.mount_mm, 2),
        body.name if body else "",
        round(body.clearance_mm, 2) if body else "",
        view.name if view else "",
        round(view.clearance_mm, 2) if view else "",
    ]


def layout_csv(layout: Layout) -> str:
    """The layout as a table: a header, then one line per camera."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(_row(placement) for placement in layout.placements)
    return text.getvalue()
