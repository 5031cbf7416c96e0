"""How far the cameras of a plan give way, as a section of its page."""

from __future__ import annotations

from common.page.html import esc, section, table
from rig.build.mounts.plan import MountPlan, Sag

WORDS = (
    "How far each camera sinks and leans under the weight of the whole rig, with profiles as beams "
    "and joints as rigid; and how far a touch of 5 N moves it while it lasts. Whole millimetres of "
    "the sag are aimed out: the setting sheets say what to set more, and the tapes are taken with "
    "everything hung. What is left is compared with what the design allows."
)
HEAD = (
    "Camera", "Sinks mm", "Moves mm", "Leans °", "Touched: mm", "°", "Left, at worst", "Allowed",
)  # fmt: skip


def stiffness(plan: MountPlan) -> str:
    """The section; empty for a plan of which nothing is known."""
    if not plan.sags:
        return ""
    return section("stiffness", "Stiffness", WORDS, table(HEAD, [_row(sag) for sag in plan.sags]))


def _row(sag: Sag) -> tuple[str, ...]:
    worst = sag.worst
    unit = "°" if worst.unit == "deg" else " mm"
    left = f"{esc(worst.setting)} {worst.left:+.2f}{unit}"
    return (
        esc(sag.camera),
        f"{-float(sag.shift_mm[2]):.2f}",
        f"{sag.shift:.2f}",
        f"{sag.lean_deg:.3f}",
        f"{sag.touched_mm:.2f}",
        f"{sag.touched_deg:.3f}",
        f"<b>{left}</b>" if worst.share > 1.0 else left,
        f"{worst.allowed:.2f}",
    )
