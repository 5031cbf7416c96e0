"""The check sheet: what an inclinometer, a picture and a tape must show on every camera."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats
from rig.build.drawings.figures import deg, fixed, mm
from rig.build.drawings.frame import A3_LANDSCAPE_MM, framed
from rig.build.drawings.items import Sheet
from rig.build.drawings.lists import csv_text
from rig.build.drawings.tables import Table, table_sheets
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.verifying import ASIDE_MM, ENDS, RULE_MM, Check, Verification, verification

LEAN_COLUMNS = ("Camera", "Optical axis up °", "Along the width, right end up °",
                "Along the height, top end up °")  # fmt: skip
FIELDS = (
    "camera", "axis_up_deg", "width_right_up_deg", "height_top_up_deg", "mark_mm",
    "datum_x_px", "datum_y_px", "over_x_px", "over_y_px", "left_x_px", "left_y_px",
    *(f"datum_to_{end}_mm" for end in ENDS), "floor_mark", *(f"floor_to_{end}_mm" for end in ENDS),
    "second_mark", "second_to_middle_mm",
)  # fmt: skip


def check_sheets(plan: MountPlan) -> tuple[Sheet, ...]:
    """Three tables for all cameras."""
    found = verification(plan)
    return framed(plan.name, table_sheets(_tables(found), "Check sheet", A3_LANDSCAPE_MM))


def checks_csv(plan: MountPlan) -> str:
    """A line per camera with the figures of all three tables."""
    found = verification(plan)
    rows = (
        (c.camera, *_leans(c), mm(found.mark_mm), *_pixels(c), *_lengths(c.datum_mm),
         *_floor(c))
        for c in found.checks
    )  # fmt: skip
    return csv_text(FIELDS, rows)


def _tables(found: Verification) -> list[Table]:
    far, rule = f"{found.mark_mm:g} mm", f"{RULE_MM:g} mm"
    marks = ("Datum x px", "y px", f"{far} over it x px", "y px", f"{far} to the left x px", "y px")
    tapes = (
        "Camera", *(f"Datum to {end}" for end in ENDS),
        "Floor mark", *(f"to {end}" for end in ENDS),
        "Second floor mark", "to the middle",
    )  # fmt: skip
    checks = found.checks
    return [
        Table(
            "1. Inclinometer, on a rule that lies flat on the front of the lens",
            LEAN_COLUMNS,
            tuple((c.camera, *_leans(c)) for c in checks),
        ),
        Table(
            "2. Picture: where three marks on a square at the datum appear; left is the subject's",
            ("Camera", *marks),
            tuple((c.camera, *_pixels(c)) for c in checks),
        ),
        Table(
            f"3. Tape to the ends of a rule of {rule}, middle on the lens; floor marks "
            f"{ASIDE_MM:g} mm from under the datum, mm",
            tapes,
            tuple((c.camera, *_lengths(c.datum_mm), *_floor(c)) for c in checks),
        ),
    ]


def _leans(check: Check) -> tuple[str, ...]:
    return tuple(deg(float(v)) for v in check.leans_deg)


def _pixels(check: Check) -> tuple[str, ...]:
    return tuple("–" if np.isnan(v) else fixed(float(v), 1) for v in check.marks_px.ravel())


def _lengths(lengths_mm: Floats) -> tuple[str, ...]:
    return tuple(mm(float(v)) for v in lengths_mm)


def _floor(check: Check) -> tuple[str, ...]:
    first, second = check.floor_marks
    return (first, *_lengths(check.floor_mm), second, mm(check.middle_mm))
