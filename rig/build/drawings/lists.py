"""Settings, tapes and poses as CSV: what the setting sheets say, for a spreadsheet."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence

from rig.build.drawings.figures import mm, pose_figures, setting_text
from rig.build.mounts.plan import MountPlan, set_for_weight

SETTING_FIELDS = (
    "camera",
    "setting",
    "value",
    "unit",
    "step",
    "low",
    "high",
    "off_by_plus",
    "off_by_minus",
    "limit",
    "measured_from",
    "gives_way_by",
    "set_more_by",
    "set_to",
)
TAPE_FIELDS = ("camera", "from", "to", "length_mm")
POSE_FIELDS = (
    "camera",
    "x_from_datum_mm",
    "y_from_datum_mm",
    "z_from_datum_mm",
    "pan_deg",
    "tilt_deg",
    "roll_deg",
    "focus_mm",
)


def csv_text(fields: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Rows under their fields."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(fields)
    writer.writerows(rows)
    return text.getvalue()


def settings_csv(plan: MountPlan) -> str:
    """A line per setting: its value, what can be set, and how far it may be off.

    ``value`` is that of the rig's drawing; ``set_to`` has ``set_more_by`` for its weight in it.
    """
    found = {(t.camera, t.setting): t for t in plan.tolerances}

    def finite(value: float) -> str:
        return "" if math.isinf(value) else f"{abs(value):.2f}"

    gives = {(sag.camera, give.setting): give for sag in plan.sags for give in sag.gives}
    sinking = {sag.camera: sag for sag in plan.sags}
    rows = []
    for mount in plan.mounts:
        for s in mount.settings:
            tolerance = found.get((mount.name, s.name))
            off = ("", "", "")
            if tolerance is not None:
                off = (finite(tolerance.plus), finite(tolerance.minus), tolerance.limit)
            span = (f"{s.step:g}", f"{s.low:g}", f"{s.high:g}")
            give = gives.get((mount.name, s.name))
            sag = ("", "") if give is None else (f"{give.off:.3f}", f"{give.set_more:g}")
            told = setting_text(set_for_weight(s, sinking.get(mount.name)))
            figures = (setting_text(s), s.unit, *span, *off, s.measured_from, *sag, told)
            rows.append((mount.name, s.name, *figures))
    return csv_text(SETTING_FIELDS, rows)


def tapes_csv(plan: MountPlan) -> str:
    """A line per tape measure."""
    rows = (
        (mount.name, tape.start, tape.end, mm(tape.length_mm))
        for mount in plan.mounts
        for tape in mount.tapes
    )
    return csv_text(TAPE_FIELDS, rows)


def poses_csv(plan: MountPlan) -> str:
    """A line per camera: optical centre from the datum, and how it looks."""
    return csv_text(POSE_FIELDS, (pose_figures(m.camera, plan.datum_rig_mm) for m in plan.mounts))
