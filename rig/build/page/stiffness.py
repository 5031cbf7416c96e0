"""How far the cameras of a plan give way, as a section of its page."""

from __future__ import annotations

from common.page.html import element, esc, section, table
from rig.build.mounts.plan import MountPlan, Sag, Stance

WORDS = (
    "How far each camera sinks and leans under the weight of the whole rig, with profiles as beams "
    "and joints as rigid; and how far a touch of 5 N moves it while it lasts. Whole millimetres of "
    "the sag are aimed out: the settings hold them already, and the tapes are taken with "
    "everything hung. What is left is compared with what the design allows."
)
TIPPING = (
    "What stands by itself is to withstand a level push at the height of the head, a fifth of its "
    "weight and 20 N at least. Below zero it would fall over by itself. Its mass is with what was "
    "taken where none is known, as the notes say."
)
TIPPING_HEAD = ("Feet", "Mass kg", "Tipped by N", "Towards", "Asked N")
HEAD = (
    "Camera", "Sinks mm", "Moves mm", "Leans °", "Touched: mm", "°", "Left, at worst", "Allowed",
)  # fmt: skip


def stiffness(plan: MountPlan) -> str:
    """The section; empty for a plan of which nothing is known."""
    if not plan.sags:
        return ""
    tables = table(HEAD, [_row(sag) for sag in plan.sags])
    if plan.stances:
        tables += element("p", esc(TIPPING))
        tables += table(TIPPING_HEAD, [_stance(stance) for stance in plan.stances])
    return section("stiffness", "Stiffness", WORDS, tables)


def _stance(stance: Stance) -> tuple[str, ...]:
    tips = f"{stance.tips_n:.0f}"
    return (
        esc(", ".join(stance.on)),
        f"{stance.mass_kg:.1f}",
        tips if stance.stands else f"<b>{tips}</b>",
        esc(stance.toward),
        f"{stance.push_n:.0f}",
    )


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
