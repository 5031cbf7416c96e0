"""One joint of each kind drawn apart: what meets there, what holds it, and which way it goes on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull

from geometry.arrays import Floats
from rig.build.drawings.frame import A3_LANDSCAPE_MM, BLOCK_MM, MARGIN_MM, Content, fitted, framed
from rig.build.drawings.hidden import visible_lines
from rig.build.drawings.isometric import APART_MM, BALLOON_MM, BEFORE, BEHIND, balloons, placed
from rig.build.drawings.items import Item, Line, Sheet, Text
from rig.build.drawings.layout import SheetView
from rig.build.drawings.views import CAMERA_KINDS, plan_solids
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.structure import Joint, Member, Solid, Structure
from rig.build.parts.bill import BillLine
from rig.build.parts.screws import Sized, sized
from rig.catalogue import Catalogue

CROP_MM = 90.0
"""So far from its joint a member or a plate is drawn: its marks are on other sheets."""

APART_SHARE = 0.7
"""How far what is joined is drawn apart, as a share of :data:`CROP_MM`; brackets go half as far."""

GRIDS = ((1, 1), (2, 1), (2, 2), (3, 2), (4, 2), (5, 2))
"""Columns and rows of a sheet: the first that holds all joints, or the last on more sheets."""

LINE_MM, TEXT_MM = 3.6, 2.2
Takes = tuple[tuple[str, float | None, int], ...]
Kind = tuple[str, str, Takes]
"""What is joined to what, and what that takes: part, length of a screw, count."""


def exploded_sheets(
    plan: MountPlan, lines: Sequence[BillLine], catalogue: Catalogue
) -> tuple[Sheet, ...]:
    """Sheets of up to six joints, one of every kind; none without joints.

    Balloons have the numbers of the bill's lines, as on the isometric sheet.
    """
    structure = plan.structure
    kinds: dict[Kind, list[Joint]] = {}
    for joint in structure.joints:
        kinds.setdefault(_kind(joint, structure, catalogue), []).append(joint)
    solids = plan_solids(plan)
    view = BEFORE if structure.plates else BEHIND
    columns, rows = next((g for g in GRIDS if g[0] * g[1] >= len(kinds)), GRIDS[-1])
    paper = np.array(A3_LANDSCAPE_MM) - 2.0 * MARGIN_MM - np.array([0.0, BLOCK_MM[1]])
    size = paper / np.array([columns, rows])
    pages: list[list[Item]] = []
    for number, ((_, _, takes), joints) in enumerate(kinds.items()):
        row, column = divmod(number % (columns * rows), columns)
        if row == column == 0:
            pages.append([])
        place = np.array([column, rows - 1 - row]) * size
        corner = place + MARGIN_MM + np.array([0.0, BLOCK_MM[1]])
        drawn = _drawing(joints[0], structure, solids, view)
        pages[-1] += _cell(drawn, _words(takes, joints, catalogue), lines, view, corner, size)
    title = "Joints, drawn apart"
    return framed(
        plan.name, [Content(title, A3_LANDSCAPE_MM, tuple(p), to_scale=False) for p in pages]
    )


def _kind(joint: Joint, structure: Structure, catalogue: Catalogue) -> Kind:
    """What a joint is of, and what it takes."""
    placed = {part.id: part.part for part in structure.parts}
    placed |= {member.id: "member" for member in structure.members}
    placed |= {plate.id: "plate" for plate in structure.plates}
    placed |= {wedge.id: "wedge" for wedge in structure.wedges}
    on, other = (placed.get(end, "camera") for end in (joint.on, joint.other))
    counts = Counter(part.part for part in structure.parts if part.joint == joint.id)
    takes: list[Sized] = [(part, None, count) for part, count in counts.items()]
    takes += sized(joint, structure, catalogue)
    return on, other, tuple(sorted(takes, key=lambda entry: (entry[0], entry[1] or 0.0)))


def _words(takes: Takes, joints: list[Joint], catalogue: Catalogue) -> list[str]:
    first = joints[0]
    more = f", and {len(joints) - 1} more like it" if len(joints) > 1 else ""
    words = [f"{first.other} on {first.on}{more}"]
    for part, length, count in takes:
        name = catalogue.find(part)[1].name
        words.append(f"{count} × {name}" + ("" if length is None else f" × {length:g} mm"))
    return words


Drawn = list[tuple[Solid, Floats, str]]
"""A solid where it is drawn, the way (3,) that it came, and the part that it is of."""


def _drawing(joint: Joint, structure: Structure, solids: Sequence[Solid], view: SheetView) -> Drawn:
    """The solids of a joint, cropped and drawn apart."""
    parts = {m.id: m.part for m in structure.members} | {p.id: p.part for p in structure.parts}
    members = {m.id: m for m in structure.members}

    def of(owner: str) -> list[Solid]:
        found = [s for s in solids if s.owner == owner]
        return [_cropped(s, members.get(owner), joint.point_mm) for s in found]

    on, other = of(joint.on), of(joint.other)
    if not on or not other:
        return [(s, np.zeros(3), parts.get(s.owner, s.owner)) for s in (*on, *other)]
    away = _way(on, other)
    far = APART_SHARE * CROP_MM
    out: Drawn = [(s, np.zeros(3), parts.get(s.owner, s.owner)) for s in on]
    out += [(_moved(s, far * away), far * away, parts.get(s.owner, s.owner)) for s in other]
    for part in (p for p in structure.parts if p.joint == joint.id):
        mine = [s for s in solids if s.owner == part.id]
        if part.id in (joint.on, joint.other) or not mine:
            continue
        middle = np.concatenate([s.corners_mm for s in mine]).mean(axis=0) - joint.point_mm
        aside = middle - (middle @ away) * away
        length = float(np.linalg.norm(aside))
        if length < 1.0:
            aside, length = np.cross(away, view.axes[2]), 1.0
        move = far / 2.0 * (away + aside / length)
        out += [(_moved(s, move), move, part.part) for s in mine]
    return out


def _cropped(solid: Solid, member: Member | None, about_mm: Floats) -> Solid:
    """A solid no farther from a joint than that; of a member along itself."""
    if member is None:
        low, high = about_mm - CROP_MM, about_mm + CROP_MM
        cut = np.clip(solid.corners_mm, low, high) if solid.kind == "plate" else solid.corners_mm
        return Solid(solid.owner, solid.kind, cut)
    start, end = member.axis_mm[0], member.axis_mm[-1]
    along = (end - start) / np.linalg.norm(end - start)
    place = (solid.corners_mm - about_mm) @ along
    cut = np.clip(place, -CROP_MM, CROP_MM)
    if np.ptp(cut) < 1.0:
        return solid
    return Solid(solid.owner, solid.kind, solid.corners_mm + (cut - place)[:, None] * along)


def _way(on: Sequence[Solid], other: Sequence[Solid]) -> Floats:
    """The direction (3,) in which the other solids leave the first: off the face they share."""
    ours = np.concatenate([s.corners_mm for s in on])
    theirs = np.concatenate([s.corners_mm for s in other])
    normals = np.concatenate([
        ConvexHull(ours).equations[:, :3], -ConvexHull(theirs).equations[:, :3],
    ])  # fmt: skip
    gaps = (theirs @ normals.T).min(axis=0) - (ours @ normals.T).max(axis=0)
    return np.asarray(normals[int(np.argmax(gaps))])


def _moved(solid: Solid, by_mm: Floats) -> Solid:
    return Solid(solid.owner, solid.kind, solid.corners_mm + by_mm)


def _cell(
    drawn: Drawn, words: list[str], lines: Sequence[BillLine], view: SheetView,
    corner: Floats, size: Floats,
) -> list[Item]:  # fmt: skip
    """One joint with its words, in a cell whose lower left corner is ``corner``."""
    top = float(corner[1] + size[1]) - 7.0
    items: list[Item] = [
        fitted(
            Text(text, float(corner[0]) + 4.0, top - k * LINE_MM, TEXT_MM, bold=k == 0),
            float(size[0]) - 8.0,
        )
        for k, text in enumerate(words)
    ]
    if not drawn:
        return items
    beside = np.array([APART_MM + 2.0 * BALLOON_MM, 4.0])
    room = size - np.array([0.0, 7.0 + LINE_MM * len(words)]) - 2.0 * beside
    joint = placed(view, [solid for solid, _, _ in drawn], corner + beside, room)
    shown = visible_lines([s.corners_mm for s, _, _ in drawn], view.axes)
    numbers = {line.part: k for k, line in reversed(list(enumerate(lines, 1)))}
    pointed: dict[int, Floats] = {}
    for (solid, came, part), found in zip(drawn, shown, strict=True):
        style = "camera" if solid.kind in CAMERA_KINDS else "visible"
        items += [Line(segment, style) for segment in joint.flat(found)]
        middle = solid.corners_mm.mean(axis=0)
        if came.any():
            items.append(Line(joint.paper(np.stack([middle, middle - came])), "axis"))
        if part in numbers:
            pointed.setdefault(numbers[part], joint.paper(middle[None])[0])
    return items + balloons(joint, list(pointed.items()))
