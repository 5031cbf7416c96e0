"""The lists as CSV (UTF-8, a header, one unit per column name) and as JSON."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from typing import Any

from rig.build.mounts.plan import MountPlan
from rig.build.mounts.structure import joint_side
from rig.build.parts.bill import Bill
from rig.build.parts.cuts import Cut

BILL_COLUMNS = (
    "kind",
    "part",
    "name",
    "maker",
    "quantity",
    "length_mm",
    "mass_g",
    "price",
    "cost",
    "currency",
    "note",
    "number",
)
CUT_COLUMNS = (
    "part",
    "name",
    "role",
    "length_mm",
    "quantity",
    "members",
    "radius_mm",
    "mass_g",
    "note",
    "mitre_start_deg",
    "mitre_end_deg",
    "long_side_mm",
)
JOINT_COLUMNS = (
    "joint",
    "on",
    "other",
    "along_mm",
    "angle_deg",
    "x_from_datum_mm",
    "y_from_datum_mm",
    "z_from_datum_mm",
    "fasteners",
    "along_from",
    "side",
)
LISTED = "; "
"""Stands between ids in one cell."""


def _figure(value: float | None, decimals: int) -> str:
    return "" if value is None else f"{value:.{decimals}f}"


def _number(value: float | None, decimals: int) -> float | None:
    return None if value is None else round(value, decimals)


def as_csv(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Rows under a header."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_harmless(cell) for cell in row] for row in rows)
    return text.getvalue()


def _harmless(cell: object) -> object:
    """A spreadsheet takes text that begins like a formula for one; a blank before it prevents."""
    formula = isinstance(cell, str) and cell[:1] in ("=", "@", "+", "\t")
    return f" {cell}" if formula else cell


def as_json(document: dict[str, Any]) -> str:
    """A document as strict JSON."""
    return json.dumps(document, allow_nan=False, ensure_ascii=False, indent=1) + "\n"


def bill_csv(bill: Bill) -> str:
    """One line per part."""
    rows = (
        (
            line.kind,
            line.part,
            line.name,
            line.maker,
            line.quantity,
            _figure(line.length_mm, 1),
            _figure(line.mass_g, 1),
            _figure(line.price, 2),
            _figure(line.cost, 2),
            bill.currency if line.cost is not None else "",
            line.note,
            number,
        )
        for number, line in enumerate(bill.lines, 1)
    )
    return as_csv(BILL_COLUMNS, rows)


def bill_json(bill: Bill) -> str:
    """The same with the sums, and which parts have no mass or price."""
    lines = [
        {
            "kind": line.kind,
            "part": line.part,
            "name": line.name,
            "maker": line.maker,
            "quantity": line.quantity,
            "length_mm": _number(line.length_mm, 1),
            "mass_g": _number(line.mass_g, 1),
            "price": _number(line.price, 2),
            "cost": _number(line.cost, 2),
            "note": line.note,
            "number": number,
        }
        for number, line in enumerate(bill.lines, 1)
    ]
    total = {
        "mass_g": round(bill.mass_g, 1),
        "cost": _number(bill.cost, 2),
        "currency": bill.currency,
        "without_mass": list(bill.without_mass),
        "without_price": list(bill.without_price),
    }
    return as_json({"schema": "rigwright.bill/1", "lines": lines, "total": total})


def cuts_csv(cuts: tuple[Cut, ...]) -> str:
    """One line per length, role and profile."""
    rows = (
        (
            cut.part,
            cut.name,
            cut.role,
            _figure(cut.length_mm, 1),
            cut.quantity,
            LISTED.join(cut.members),
            _figure(cut.radius_mm, 1),
            _figure(cut.mass_g, 1),
            cut.note,
            *(_figure(mitre, 2) for mitre in cut.mitres_deg),
            _figure(cut.long_side_mm, 1),
        )
        for cut in cuts
    )
    return as_csv(CUT_COLUMNS, rows)


def cuts_json(cuts: tuple[Cut, ...]) -> str:
    """The same as JSON."""
    document = [
        {
            "part": cut.part,
            "name": cut.name,
            "role": cut.role,
            "length_mm": round(cut.length_mm, 1),
            "quantity": cut.quantity,
            "members": list(cut.members),
            "radius_mm": _number(cut.radius_mm, 1),
            "mass_g": _number(cut.mass_g, 1),
            "note": cut.note,
            "mitres_deg": [round(mitre, 2) for mitre in cut.mitres_deg],
            "long_side_mm": round(cut.long_side_mm, 1),
        }
        for cut in cuts
    ]
    return as_json({"schema": "rigwright.cuts/1", "cuts": document})


def joints_csv(plan: MountPlan) -> str:
    """Where each joint is marked: along the member it sits on, and its place from the datum.

    ``along_mm`` counts from the end that ``along_from`` names to the middle of the joint;
    ``side`` is that of ``on`` where the other part lies.
    """
    members = {member.id: member for member in plan.structure.members}
    rows = (
        (
            joint.id,
            joint.on,
            joint.other,
            _figure(joint.along_mm, 1),
            _figure(joint.angle_deg, 2),
            *(_figure(float(value), 1) for value in joint.point_mm - plan.datum_rig_mm),
            LISTED.join(f"{count}x{part}" for part, count in joint.fasteners.items()),
            members[joint.on].start if joint.on in members else "",
            joint_side(joint, members),
        )
        for joint in plan.structure.joints
    )
    return as_csv(JOINT_COLUMNS, rows)


def joints_json(plan: MountPlan) -> str:
    """The same as JSON."""
    members = {member.id: member for member in plan.structure.members}
    document = [
        {
            "joint": joint.id,
            "on": joint.on,
            "other": joint.other,
            "along_mm": _number(joint.along_mm, 1),
            "angle_deg": _number(joint.angle_deg, 2),
            "point_rig_mm": [round(float(value), 1) for value in joint.point_mm],
            "point_from_datum_mm": [
                round(float(value), 1) for value in joint.point_mm - plan.datum_rig_mm
            ],
            "fasteners": dict(joint.fasteners),
            "along_from": members[joint.on].start if joint.on in members else "",
            "side": joint_side(joint, members),
        }
        for joint in plan.structure.joints
    ]
    return as_json({"schema": "rigwright.joints/1", "joints": document})
