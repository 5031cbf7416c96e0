"""One sheet per camera: what to set, how exactly, and two tapes that check it."""

from __future__ import annotations

import math

import numpy as np

from geometry.arrays import Floats
from rig.build.drawings.annotate import Labels
from rig.build.drawings.chainrows import CHAIN_COLUMNS, CHAIN_WORDS, chain_rows
from rig.build.drawings.figures import POSE_COLUMNS, fixed, mm, pose_figures, setting_text
from rig.build.drawings.frame import A4_MM, BLOCK_MM, MARGIN_MM, Content, fitted, framed
from rig.build.drawings.items import Item, Line, Sheet, Text
from rig.build.drawings.layout import PlacedView, SheetView, views_of
from rig.build.drawings.tables import Table, table_items
from rig.build.drawings.views import plan_solids
from rig.build.mounts.plan import Give, MountPlan, Tolerance, set_for_weight
from rig.build.mounts.settings import CameraMount, Setting
from rig.solids.sight import outline

SETTING_COLUMNS = ("Setting", "Set to", "Unit", "Step", "May be off by", "Measured from")
WEIGHT_COLUMN = "For its weight"
WEIGHT_WORDS = (
    "The rig sinks under its weight. “Set to” has “For its weight” in it already: set just that, "
    "and the camera sinks to its place.",
    "In brackets: what the camera gives way by where nothing is set for it; do not set it. Tapes "
    "hold with every camera hung.",
)
WEIGHT_CHAIN_WORDS = "Of what is set, leave out here what is for its weight."
WORDS_MM = 3.6

TAPE_COLUMNS = ("Tape from", "to", "mm")
LEFT_MM = MARGIN_MM + 8.0
WIDE_MM = A4_MM[0] - 2.0 * LEFT_MM
PICTURE_MM = (WIDE_MM / 2.0 - 4.0, 42.0)


def setting_sheets(plan: MountPlan) -> tuple[Sheet, ...]:
    """The setting sheets of all cameras, A4, in the plan's order."""
    maps = {view.title: _map(plan, view) for view in views_of(plan.structure)[:2]}
    contents = [_content(plan, mount, maps) for mount in plan.mounts]
    return framed(plan.name, contents)


def _content(
    plan: MountPlan, mount: CameraMount, maps: dict[str, tuple[PlacedView, list[Item]]]
) -> Content:
    top = A4_MM[1] - MARGIN_MM - 9.0
    items: list[Item] = [
        fitted(Text(mount.name, LEFT_MM, top - 4.0, 6.0, bold=True), WIDE_MM),
        fitted(Text(mount.camera.camera.name, LEFT_MM, top - 11.0, 2.6), WIDE_MM),
        fitted(Text(_carried(mount), LEFT_MM, top - 16.5, 2.2), WIDE_MM),
    ]
    y = top - 23.0
    for table in _tables(plan, mount):
        if table.rows:
            items += table_items(table, LEFT_MM, y, WIDE_MM)
            y -= table.height_mm(WIDE_MM) + 6.0
        if WEIGHT_COLUMN in table.columns:
            y += 2.0
            for words in WEIGHT_WORDS:
                items.append(fitted(Text(words, LEFT_MM, y, 2.0), WIDE_MM))
                y -= WORDS_MM
    words = f"{CHAIN_WORDS} {WEIGHT_CHAIN_WORDS}" if plan.sags else CHAIN_WORDS
    items.append(fitted(Text(words, LEFT_MM, y + 1.5, 2.0), WIDE_MM))
    low = MARGIN_MM + BLOCK_MM[1] + 8.0
    for k, (title, (placed, ground)) in enumerate(maps.items()):
        x = LEFT_MM + k * (PICTURE_MM[0] + 8.0)
        items.append(Text(title, x, low + PICTURE_MM[1] + 3.0, 2.2, bold=True))
        shift = np.array([x, low])
        items += [_shifted(item, shift) for item in ground]
        items += _highlighted(placed, mount, shift)
    return Content(f"Setting sheet {mount.name}", A4_MM, tuple(items), to_scale=False)


def _carried(mount: CameraMount) -> str:
    words = " – ".join(mount.carried_by)
    return f"Held by: {words}" if words else "Held by the ground"


def _tables(plan: MountPlan, mount: CameraMount) -> list[Table]:
    found = {t.setting: t for t in plan.tolerances if t.camera == mount.name}
    sag = next((sag for sag in plan.sags if sag.camera == mount.name), None)
    gives = {} if sag is None else {give.setting: give for give in sag.gives}
    columns: tuple[str, ...] = SETTING_COLUMNS
    settings: tuple[tuple[str, ...], ...] = tuple(
        _setting_row(set_for_weight(s, sag), found.get(s.name)) for s in mount.settings
    )
    if gives:
        columns = (*columns[:5], WEIGHT_COLUMN, columns[5])
        settings = tuple(
            (*row[:5], _for_weight(gives[s.name]), row[5])
            for row, s in zip(settings, mount.settings, strict=True)
        )
    tapes = tuple((tape.start, tape.end, mm(tape.length_mm)) for tape in mount.tapes)
    pose = pose_figures(mount.camera, plan.datum_rig_mm)
    return [
        Table("Set", columns, settings, wraps=True),
        Table("Check with a tape measure", TAPE_COLUMNS, tapes),
        Table("What results: optical centre from the datum", POSE_COLUMNS, (pose,)),
        Table(
            "Step by step from the datum to the optical centre",
            CHAIN_COLUMNS,
            chain_rows(mount, plan.datum_rig_mm),
        ),
    ]


def _setting_row(setting: Setting, tolerance: Tolerance | None) -> tuple[str, ...]:
    step = f"{setting.step:g}" if setting.step > 0.0 else "as made"
    return (
        setting.name,
        setting_text(setting),
        setting.unit,
        step,
        "–" if tolerance is None else _tolerance(tolerance),
        setting.measured_from,
    )


def _for_weight(give: Give) -> str:
    """What is set more; in brackets what an angle gives way by, or what is made to the figure."""
    if give.unit == "mm" and give.step > 0.0:
        return f"{give.set_more:+g}" if give.set_more else "0"
    return f"({fixed(give.off, 2)})"


def _tolerance(tolerance: Tolerance) -> str:
    """How far a setting may be off, both ways; ∞ when no limit broke in the range tried."""

    def side(value: float) -> str:
        # What is made to the figure is made more exactly than anybody sets.
        return "∞" if math.isinf(value) else fixed(abs(value), 1 if abs(value) >= 1.0 else 2)

    plus, minus = side(tolerance.plus), side(tolerance.minus)
    return f"± {plus}" if plus == minus else f"+ {plus} / - {minus}"


def _map(plan: MountPlan, view: SheetView) -> tuple[PlacedView, list[Item]]:
    """A small picture of the rig in which each sheet marks its camera."""
    solids = plan_solids(plan)
    corners = [s.corners_mm @ view.axes[:2].T for s in solids]
    everything = np.concatenate([*corners, (view.axes[:2] @ plan.datum_rig_mm)[None]])
    low, high = everything.min(axis=0), everything.max(axis=0)
    n = float(((high - low) / PICTURE_MM).max())
    placed = PlacedView(view, low, high, np.zeros(2), n)
    items: list[Item] = [
        Line(outline(placed.flat(flat)), "thin", True)
        for solid, flat in zip(solids, corners, strict=True)
        if solid.kind in ("member", "plate", "camera")
    ]
    x, y = placed.paper(plan.datum_rig_mm[None])[0]
    items += [
        Line(np.array([[x - 2, y], [x + 2, y]]), "datum"),
        Line(np.array([[x, y - 2], [x, y + 2]]), "datum"),
    ]
    return placed, items


def _shifted(item: Item, shift: Floats) -> Item:
    if isinstance(item, Line):
        return Line(item.points_mm + shift, item.style, item.closed)
    return item


def _highlighted(placed: PlacedView, mount: CameraMount, shift: Floats) -> list[Item]:
    """The camera of this sheet, with its optical axis and its name."""
    from rig.solids.bodies import place_body

    camera = mount.camera
    shapes = [outline(placed.paper(part)) + shift for part in place_body(camera).parts]
    reach = 0.5 * camera.focus_distance_mm
    ends = camera.pose.position_rig_mm + np.array([[0.0], [reach]]) * camera.pose.axis_rig
    items: list[Item] = [Line(shape, "camera", True) for shape in shapes]
    axis = placed.paper(ends) + shift
    items.append(Line(axis, "axis"))
    corners = np.concatenate(shapes)
    labels = Labels()
    labels.keep_off(corners.min(axis=0), corners.max(axis=0))
    x, y = corners.mean(axis=0)
    return [*items, *labels.place(mount.name, float(x), float(y), 2.2, "camera")]
