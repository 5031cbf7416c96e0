"""The rig in isometric projection, with balloons that number its parts as the bill does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry.arrays import Floats
from rig.build.drawings.frame import A3_LANDSCAPE_MM, BLOCK_MM, MARGIN_MM, Content, framed
from rig.build.drawings.hidden import visible_lines
from rig.build.drawings.items import Circle, Item, Line, Sheet, Text
from rig.build.drawings.layout import PlacedView, SheetView
from rig.build.drawings.tables import Table, table_items, table_sheets
from rig.build.drawings.views import CAMERA_KINDS, plan_solids
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.structure import Solid
from rig.build.parts.bill import BillLine

ROOT = float(np.sqrt(0.5))
SIXTH = float(np.sqrt(1.0 / 6.0))
BEHIND = SheetView(
    "Isometric, from behind the cameras", (ROOT, -ROOT, 0.0), (SIXTH, SIXTH, 2.0 * SIXTH)
)
"""Seen along a diagonal of the rig's axes: all three are shortened alike, by 0.816."""

BEFORE = SheetView(
    "Isometric, from the subject's side", (-ROOT, ROOT, 0.0), (-SIXTH, -SIXTH, 2.0 * SIXTH)
)
"""A plate would hide its cameras from behind."""

BALLOON_MM = 3.6
APART_MM = 9.0
TABLE_MM = 128.0
WITHOUT_BALLOON = "Screws, nuts and caps have a line and no balloon."
COLUMNS = ("No.", "Part", "Count", "Length mm")


def isometric_sheets(plan: MountPlan, lines: Sequence[BillLine]) -> tuple[Sheet, ...]:
    """A sheet with the rig, balloons and the bill that they number; the bill on more if it is long.

    Numbers are those of the bill's lines, counted from 1. What has no place of its own (screws,
    nuts, caps) has a line and no balloon.
    """
    solids = plan_solids(plan)
    around = APART_MM + 2.0 * BALLOON_MM
    corner = np.array([MARGIN_MM, MARGIN_MM + BLOCK_MM[1] + 4.0]) + around
    room = np.array([A3_LANDSCAPE_MM[0] - TABLE_MM, A3_LANDSCAPE_MM[1] - BLOCK_MM[1] - 12.0])
    room -= 2.0 * (MARGIN_MM + around)
    view = placed(BEFORE if plan.structure.plates else BEHIND, solids, corner, room)
    items: list[Item] = []
    drawn = visible_lines([s.corners_mm for s in solids], view.view.axes)
    for solid, found in zip(solids, drawn, strict=True):
        style = "camera" if solid.kind in CAMERA_KINDS else "visible"
        items += [Line(segment, style) for segment in view.flat(found)]
    items += balloons(view, _pointed(plan, lines, solids, view))
    top = A3_LANDSCAPE_MM[1] - MARGIN_MM - 6.0
    items.append(Text(view.view.title, MARGIN_MM + 5.0, top - 3.0, 2.6, bold=True))
    table = Table(
        "Parts, numbered as in the bill",
        COLUMNS,
        tuple(_rows(lines)),
    )
    more: list[Content] = []
    if table.height_mm() <= top - (MARGIN_MM + BLOCK_MM[1] + 6.0):
        left = A3_LANDSCAPE_MM[0] - MARGIN_MM - TABLE_MM
        items += table_items(table, left, top, TABLE_MM - 5.0)
        items.append(Text(WITHOUT_BALLOON, left, top - table.height_mm() - 4.0, 2.0))
    else:
        more = table_sheets([table], "Parts", A3_LANDSCAPE_MM)
    # A projected scale would mislead whoever measures: lengths along the axes are 0.816 of it.
    first = Content("Isometric view", A3_LANDSCAPE_MM, tuple(items), to_scale=False)
    return framed(plan.name, [first, *more])


def _rows(lines: Sequence[BillLine]) -> list[tuple[str, ...]]:
    return [
        (
            str(number),
            line.name,
            str(line.quantity),
            "–" if line.length_mm is None else f"{line.length_mm:.0f}",
        )
        for number, line in enumerate(lines, 1)
    ]


def placed(view: SheetView, solids: Sequence[Solid], corner: Floats, room: Floats) -> PlacedView:
    """Solids in the middle of a room (2,) that begins at ``corner`` (2,), as large as it allows.

    At no round scale: what is not seen along an axis is not measured on the sheet.
    """
    ends = np.concatenate([s.corners_mm for s in solids]) @ view.axes[:2].T
    low, high = ends.min(axis=0), ends.max(axis=0)
    n = float(((high - low) / room).max())
    return PlacedView(view, low, high, corner + (room - (high - low) / n) / 2.0, n)


def _pointed(
    plan: MountPlan, lines: Sequence[BillLine], solids: Sequence[Solid], view: PlacedView
) -> list[tuple[int, Floats]]:
    """The number of each line with a place, and the point (2,) that its balloon points to."""
    structure = plan.structure
    owners: dict[str, str] = {}
    for member in structure.members:
        owners.setdefault(member.part, member.id)
    for part in structure.parts:
        owners.setdefault(part.part, part.id)
    owners |= {p.id: p.id for p in structure.plates} | {w.id: w.id for w in structure.wedges}
    for mount in plan.mounts:
        model, _, lens = mount.camera.camera.name.partition(" ")
        for key, kind in ((mount.camera.camera.name, ""), (model, ""), (lens, "lens")):
            owners.setdefault(key, f"{mount.name}\n{kind}" if kind else mount.name)
    found = []
    for number, line in enumerate(lines, 1):
        owner, _, kind = owners.get(line.part, "").partition("\n")
        mine = [s for s in solids if s.owner == owner and kind in ("", s.kind)]
        if owner and mine:
            found.append((number, view.paper(mine[0].corners_mm).mean(axis=0)))
    return found


def balloons(view: PlacedView, pointed: list[tuple[int, Floats]]) -> list[Item]:
    """Numbers in circles in two columns beside what is drawn, in the order of what they point to.

    ``pointed``: each number with its point (2,) on the paper.
    """
    middle = float(view.origin_mm[0] + view.size_mm[0] / 2.0)
    items: list[Item] = []
    for left in (True, False):
        side = [(n, at) for n, at in pointed if (at[0] < middle) == left]
        side.sort(key=lambda entry: -float(entry[1][1]))
        x = float(view.origin_mm[0]) - APART_MM if left else (
            float(view.origin_mm[0] + view.size_mm[0]) + APART_MM
        )  # fmt: skip
        y = np.inf
        for number, at in side:
            y = min(float(at[1]), y - APART_MM)
            rim = x + (BALLOON_MM if left else -BALLOON_MM)
            items += [
                Line(np.array([[rim, y], at]), "thin"),
                Circle(float(at[0]), float(at[1]), 0.5, "mark"),
                Circle(x, y, BALLOON_MM, "mark"),
                Text(str(number), x, y - 1.1, 2.6, "middle", bold=True),
            ]
    return items
