"""The drawing of the whole rig: front, top and side in third-angle projection, and its tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from rig.build.drawings.annotate import PITCH_MM, Labels, Ordinate, merged, ordinate_items
from rig.build.drawings.figures import POSE_COLUMNS, mm, pose_figures
from rig.build.drawings.frame import A3_LANDSCAPE_MM, MARGIN_MM, Content, framed
from rig.build.drawings.hidden import visible_lines
from rig.build.drawings.items import (
    CameraMark,
    Dimension,
    Item,
    Line,
    Sheet,
    Text,
    dimension_parts,
)
from rig.build.drawings.layout import EDGE_MM, PlacedView, arranged, views_of
from rig.build.drawings.tables import Table, table_items, table_sheets
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.structure import Member, Solid, joint_side
from rig.solids.bodies import place_body
from rig.solids.sight import outline

SIZE_MM = 20.0
"""Overall sizes stand this far from what is built, beyond the ordinates of members."""

SHORT_MM = 3.0
MORE_MM = 3.0
"""Further out at the right, where a size stands between its line and the ordinates."""

NEAR_MM, FAR_MM = 6.0, 12.0
NAMES_MM, CROWD_NAMES_MM = 2.0, 1.6
MANY = 40
TITLE_MM = 25.5
AXIS_SHARE = 0.35
"""Optical axes are drawn this far of the way to the focus."""

TAGS = ("X", "Y", "Z", "PAN", "TILT", "ROLL", "FOCUS")


NOT_DRAWN = frozenset({"cable"})
CAMERA_KINDS = frozenset({"camera", "lens"})


def plan_solids(plan: MountPlan) -> list[Solid]:
    """The solids of a plan as they are drawn, with its cameras."""
    solids = [s for s in plan.structure.solids if s.kind not in NOT_DRAWN]
    owners = {s.owner for s in solids if s.kind in CAMERA_KINDS}
    for mount in plan.mounts:
        if mount.name not in owners:
            parts = place_body(mount.camera).parts
            kinds = ("camera", "lens")
            solids += [Solid(mount.name, k, p) for k, p in zip(kinds, parts, strict=False)]
    return solids


def view_sheets(plan: MountPlan, subject_mm: Floats | None = None) -> tuple[Sheet, ...]:
    """The sheets of the whole rig. ``subject_mm`` (N, 3): points whose outline shows the subject.

    The first holds the three views; the cameras' poses stand on it when there is room.
    """
    solids = plan_solids(plan)
    points = [s.corners_mm for s in solids] + [plan.datum_rig_mm[None]]
    points += [m.camera.pose.position_rig_mm[None] for m in plan.mounts]
    points += [] if subject_mm is None else [subject_mm]
    everything = np.concatenate(points)
    sides = views_of(plan.structure)
    views = arranged(everything.min(axis=0), everything.max(axis=0), sides)
    items: list[Item] = []
    named = _named(views, plan)
    items += _dimensioned(views, plan, solids)
    for view in views:
        items += _drawn(view, plan, solids, subject_mm)
    written = [part for item in items for part in _parts(item)]
    for view in views:
        items += _cameras(view, plan, written, named=view in named)
    poses = Table("Cameras, optical centre from the datum", POSE_COLUMNS, _pose_rows(plan))
    tables = [poses, *_structure_tables(plan)]
    on_first = _in_corner(views, poses)
    if on_first:
        items, tables = items + on_first, tables[1:]
    first = Content("Views", A3_LANDSCAPE_MM, tuple(items), views[0].denominator, projected=True)
    more = table_sheets(tables, "Cameras, members and joints", A3_LANDSCAPE_MM)
    return framed(plan.name, [first, *more])


def _drawn(
    view: PlacedView, plan: MountPlan, solids: list[Solid], subject_mm: Floats | None
) -> list[Item]:
    """What is seen in a view, with names and optical axes."""
    items: list[Item] = []
    if subject_mm is not None:
        items.append(Line(outline(view.paper(subject_mm)), "head", True))
    lines = visible_lines([s.corners_mm for s in solids], view.view.axes)
    for solid, found in zip(solids, lines, strict=True):
        style = "camera" if solid.kind in CAMERA_KINDS else "visible"
        items += [Line(segment, style) for segment in view.flat(found)]
    x, y = view.paper(plan.datum_rig_mm[None])[0]
    items += [
        Line(np.array([[x - 3, y], [x + 3, y]]), "datum"),
        Line(np.array([[x, y - 3], [x, y + 3]]), "datum"),
    ]
    title_x, title_y = view.origin_mm[0], view.origin_mm[1] + view.size_mm[1] + TITLE_MM
    return [*items, Text(view.view.title, float(title_x), float(title_y), 2.6, bold=True)]


def _named(
    views: tuple[PlacedView, PlacedView, PlacedView], plan: MountPlan
) -> tuple[PlacedView, ...]:
    """The views that name the cameras: of many cameras only the one that spreads them most."""
    if len(plan.mounts) <= MANY:
        return views
    centres = np.array([m.camera.pose.position_rig_mm for m in plan.mounts])

    def spread(view: PlacedView) -> float:
        return float(np.ptp(view.paper(centres), axis=0).prod())

    return (max(views, key=spread),)


def _parts(item: Item) -> list[Item]:
    return dimension_parts(item) if isinstance(item, Dimension) else [item]


def _cameras(
    view: PlacedView, plan: MountPlan, written: Sequence[Item], *, named: bool
) -> list[Item]:
    """Marks at the optical centres, the optical axes, the names, and the datum's.

    ``written`` is what is on the sheet already: names keep off it where there is room.
    """
    items: list[Item] = []
    labels, many = Labels(), len(plan.mounts) > MANY
    # Where cameras crowd there is no room beside bars, and much to look at.
    labels.keep_off_items([i for i in written if isinstance(i, Text)] if many else written)
    centres = view.paper(np.array([m.camera.pose.position_rig_mm for m in plan.mounts]))
    for mount, centre in zip(plan.mounts, centres, strict=True):
        corners = view.paper(np.concatenate(place_body(mount.camera).parts))
        # Among many cameras names find room only on the bodies.
        low, high = (centre - 0.8, centre + 0.8) if many else (corners.min(0), corners.max(0))
        labels.keep_off(low, high)
    datum = view.paper(plan.datum_rig_mm[None])[0]
    items += labels.place("datum", float(datum[0]), float(datum[1]), NAMES_MM, "datum")
    size = CROWD_NAMES_MM if many else NAMES_MM
    for mount, (x, y) in zip(plan.mounts, centres, strict=True):
        camera = mount.camera
        reach = AXIS_SHARE * camera.focus_distance_mm
        end = view.paper((camera.pose.position_rig_mm + reach * camera.pose.axis_rig)[None])[0]
        items.append(Line(np.array([[x, y], end]), "axis"))
        figures = tuple(zip(TAGS, pose_figures(camera, plan.datum_rig_mm)[1:], strict=True))
        items.append(CameraMark(mount.name, float(x), float(y), figures))
        if named:
            items += labels.place(mount.name, float(x), float(y), size, "camera")
    return items


@dataclass(frozen=True, eq=False)
class _Built:
    """What is built, in a view: its corners on the paper (2,) each, and its size in words."""

    low_mm: Floats
    high_mm: Floats
    size_words: tuple[str, str]


def _built(view: PlacedView, solids: list[Solid]) -> _Built:
    ends = np.concatenate([s.corners_mm for s in solids]) @ view.view.axes[:2].T
    low, high = ends.min(axis=0), ends.max(axis=0)
    across, upwards = (mm(float(v)) for v in high - low)
    return _Built(view.flat(low), view.flat(high), (across, upwards))


def _dimensioned(
    views: tuple[PlacedView, PlacedView, PlacedView], plan: MountPlan, solids: list[Solid]
) -> list[Item]:
    """Overall sizes, and ordinates of cameras and members from the datum, each stated once."""
    front, top, side = views
    cameras = np.array([m.camera.pose.position_rig_mm for m in plan.mounts])
    items: list[Item] = []
    for view, axis, outwards in ((front, 0, -1), (front, 1, -1), (top, 1, -1), (side, 0, -1)):
        items += _row(
            view, _built(view, solids), _ordinates(view, plan, cameras, axis), axis, outwards
        )
    for view, axis in ((front, 0), (front, 1), (top, 1), (side, 0)):
        members = _ordinates(view, plan, _across(view, plan.structure.members, axis), axis)
        items += _row(view, _built(view, solids), members, axis, 1)
        items.append(_size(_built(view, solids), axis))
    return items


def _size(built: _Built, axis: int) -> Dimension:
    """The overall size along an axis of a view, beyond the ordinates."""
    (left, low), (right, high) = built.low_mm, built.high_mm
    # Its lines begin beyond the ordinates, whose figures they would cross.
    near = SIZE_MM - SHORT_MM
    if axis == 0:
        ends = (left, high + near), (right, high + near)
        return Dimension(*ends, high + SIZE_MM, False, built.size_words[0])
    ends = (right + near, low), (right + near, high)
    return Dimension(*ends, right + SIZE_MM + MORE_MM, True, built.size_words[1])


def _row(
    view: PlacedView, built: _Built, ordinates: list[Ordinate], axis: int, outwards: int
) -> list[Item]:
    """Ordinates beside what is built, when there is room for them all."""
    if len(merged(ordinates)) * PITCH_MM > max(float(view.size_mm[axis]), 30.0) + 12.0:
        return []
    start = built.high_mm[1 - axis] if outwards > 0 else built.low_mm[1 - axis]
    reach = NEAR_MM if outwards > 0 else -FAR_MM
    return ordinate_items(ordinates, float(start), reach, upright=axis == 1)


def _ordinates(view: PlacedView, plan: MountPlan, points: Floats, axis: int) -> list[Ordinate]:
    """Coordinates of points (N, 3) along one axis of a view, from the datum, as the rig counts."""
    if not len(points):
        return []
    places = view.paper(points)[:, axis]
    figures = (points - plan.datum_rig_mm) @ np.abs(view.view.axes[axis])
    return [Ordinate(float(p), mm(float(f))) for p, f in zip(places, figures, strict=True)]


def _across(view: PlacedView, members: tuple[Member, ...], axis: int) -> Floats:
    """Middles (N, 3) of straight members that run square to one axis of a view."""
    middles = []
    for member in members:
        run = member.axis_mm[-1] - member.axis_mm[0]
        square = abs(float(run @ view.view.axes[axis])) < 0.01
        if member.radius_mm is None and square:
            middles.append((member.axis_mm[0] + member.axis_mm[-1]) / 2.0)
    return np.array(middles).reshape(-1, 3)


def _pose_rows(plan: MountPlan) -> tuple[tuple[str, ...], ...]:
    return tuple(pose_figures(m.camera, plan.datum_rig_mm) for m in plan.mounts)


def _structure_tables(plan: MountPlan) -> list[Table]:
    """Members from end to end and joints, for sheets of their own."""

    def place(point: Floats) -> tuple[str, ...]:
        return tuple(mm(float(v)) for v in point - plan.datum_rig_mm)

    members = tuple(
        (m.id, m.part, m.role, mm(m.length_mm), *place(m.axis_mm[0]), *place(m.axis_mm[-1]))
        for m in plan.structure.members
    )
    named = {member.id: member for member in plan.structure.members}
    joints = tuple(
        (
            j.id,
            j.on,
            j.other,
            "–" if j.along_mm is None else mm(j.along_mm),
            "–" if j.angle_deg is None else f"{j.angle_deg:.1f}",
            *place(j.point_mm),
            joint_side(j, named) or "–",
        )
        for j in plan.structure.joints
    )
    ends = ("from X", "Y", "Z", "to X", "Y", "Z")
    tables = [
        Table(
            "Members, ends from the datum",
            ("Member", "Profile", "Role", "Length mm", *ends),
            members,
        ),
        Table(
            "Joints, from the datum",
            ("Joint", "On", "Holds", "Along mm", "Angle °", "X mm", "Y mm", "Z mm", "Side"),
            joints,
        ),
    ]
    return [table for table in tables if table.rows]


def _in_corner(views: tuple[PlacedView, PlacedView, PlacedView], table: Table) -> list[Item]:
    """The table in the room above the side view; nothing when it is too large for it."""
    _, top, side = views
    left = max(float(side.origin_mm[0]), float(top.origin_mm[0] + top.size_mm[0]) + EDGE_MM)
    low = float(side.origin_mm[1] + side.size_mm[1]) + EDGE_MM
    high, right = A3_LANDSCAPE_MM[1] - MARGIN_MM - 4.0, A3_LANDSCAPE_MM[0] - MARGIN_MM - 4.0
    wide = sum(table.widths_mm(np.inf))
    if wide > right - left or table.height_mm() > high - low:
        return []
    return table_items(table, right - wide, high, wide)
