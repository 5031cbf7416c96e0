"""The page of a mount plan: what it costs in accuracy, how it looks, what it is made of."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from common.files.plain import number
from common.page.document import drawn_page, style_sheet
from common.page.html import element, esc, figure_text, long_words, percent, plot, section, table
from common.words import of_limits
from geometry.raycast import Occluder
from rig.build.drawings.figures import POSE_COLUMNS, mm, pose_figures, setting_text
from rig.build.drawings.steps import plain_steps
from rig.build.drawings.views import plan_solids
from rig.build.mounts.plan import Figures, MountPlan, set_for_weight
from rig.build.mounts.settings import CameraMount
from rig.build.page.planlinks import files_section, shown_files
from rig.build.page.planview import plan_figure
from rig.build.page.stiffness import stiffness
from rig.build.parts.bill import Bill
from rig.build.parts.cuts import Cut

FIGURE = "plan-3d"
LISTED_FROM = 3
"""So many pieces of one step are shown one below the other."""

CONTENTS = (
    ("structure", "Structure"),
    ("accuracy", "Accuracy"),
    ("settings", "Settings"),
    ("stiffness", "Stiffness"),
    ("parts", "Parts"),
    ("cuts", "Cut list"),
    ("steps", "Steps"),
)


def render_plan_page(
    plan: MountPlan,
    bill: Bill,
    cuts: tuple[Cut, ...],
    occluder: Occluder | None = None,
    files: Mapping[str, str] | None = None,
) -> str:
    """The page as one HTML document that needs no network.

    ``files`` that lie beside the page, by name, with what they are: it links to them.
    Names may hold anything: they are escaped. ``document.body.dataset`` gets ``view``, a JSON
    summary of what is drawn, and ``ready`` once the figure stands.
    """
    solids = plan_solids(plan)
    figure, ways = plan_figure(plan, solids, occluder)
    figure.update_layout(template="none")
    parts = {"figure": json.loads(figure.to_json()), "ways": ways}
    view: dict[str, Any] = {
        "cameras": len(plan.mounts),
        "solids": len(solids),
        "kinds": len(ways),
        "parts": sum(line.quantity for line in bill.lines),
        "sigma_median_mm": number(plan.price.built.sigma_median_mm),
    }
    return drawn_page(
        plan.name,
        header=_heading(plan, shown_files(files or {})),
        main=_main(plan, bill, cuts) + files_section(files or {}),
        footer="<p>Rig frame: millimetres, X to the subject's left, Y from the cameras towards "
        "the subject, Z up. σ is one standard deviation.</p>",
        style=style_sheet() + _part("plan.css"),
        figures=json.dumps(parts, allow_nan=False),
        script=_part("plan.js"),
        view=view,
    )


def _part(name: str) -> str:
    return files("rig.build.page").joinpath(name).read_text(encoding="utf-8")


def _heading(plan: MountPlan, files: Mapping[str, str]) -> str:
    contents = [entry for entry in CONTENTS if plan.sags or entry[0] != "stiffness"]
    contents += [("files", "Files")] if files else []
    words = f"Mount plan ({plan.system}) for {len(plan.mounts)} cameras"
    links = "".join(element("a", esc(name), href=f"#{key}") for key, name in contents)
    return f"<h1>{esc(plan.name)}</h1><p>{esc(words)}</p><nav>{links}</nav>"


def _main(plan: MountPlan, bill: Bill, cuts: tuple[Cut, ...]) -> str:
    return "".join(
        (
            _verdict(plan),
            _tiles(plan, bill),
            _structure(),
            _accuracy(plan),
            _settings(plan),
            stiffness(plan),
            _parts(bill),
            _cuts(cuts),
            _steps(plan),
        )
    )


def _verdict(plan: MountPlan) -> str:
    if plan.clashes:
        word = f"{len(plan.clashes)} clashes: this plan cannot be built as it is."
        first = plan.clashes[0]
        more = f"The first: {first.one} and {first.other}. All are listed under Steps."
    elif not plan.price.built.feasible:
        word = "It can be built, but the rounded rig breaks limits of the design."
        more = f"Broken: {', '.join(plan.price.built.broken)}."
    elif plan.leaning:
        words = plan.leaning[0].words
        word = f"{words[0].upper()}{words[1:]}."
        more = "Under Stiffness stands how far each camera gives way, and what would hold it."
    elif plan.tipping:
        words = plan.tipping[0].words
        word = f"{words[0].upper()}{words[1:]}."
        more = "What would keep it on its feet stands under Stiffness and in the notes."
    else:
        word = "It can be built: nothing collides and all limits of the design hold."
        loss = percent(max(0.0, plan.price.sigma_loss))
        more = f"Settings that exist cost {loss} of the median σ."
    broken = not plan.buildable or not plan.price.built.feasible or bool(plan.tipping)
    css = "verdict broken" if broken else "verdict"
    return (
        f'<div class="{css}"><p class="word">{esc(word)}</p><p class="more">{esc(more)}</p></div>'
    )


def _tile(name: str, figure: str, note: str) -> str:
    return (
        f'<div class="tile"><div class="name">{esc(name)}</div>'
        f'<div class="figure">{figure}</div><div class="note">{esc(note)}</div></div>'
    )


def _tiles(plan: MountPlan, bill: Bill) -> str:
    built, designed = plan.price.built, plan.price.designed
    designed_words = f"{figure_text(designed.sigma_median_mm)} mm as designed"
    cost = "–" if bill.cost is None else f"{bill.cost:.2f} <small>{esc(bill.currency)}</small>"
    tiles = (
        _tile(
            "Median error σ", f"{figure_text(built.sigma_median_mm)} <small>mm</small>",
            designed_words,
        ),
        _tile(
            "Seen by two or more", percent(built.coverage_2_views),
            f"{percent(designed.coverage_2_views)} as designed",
        ),
        _tile(
            "Rigs within limits", percent(plan.yield_share),
            f"of {plan.yield_trials} built half a step off at random",
        ),
        _tile(
            "Mass", f"{bill.mass_g / 1000.0:.1f} <small>kg</small>",
            _without(bill.without_mass, "mass") + _taken(plan, bill),
        ),
        _tile(
            "Cost", cost,
            _without(bill.without_price, "price"),
        ),
    )  # fmt: skip
    return f'<div class="tiles">{"".join(tiles)}</div>'


def _without(parts: tuple[str, ...], what: str) -> str:
    """Which parts a sum leaves out; the first of a bill, cameras, weigh and cost most."""
    if not parts:
        return ""
    more = f" and {len(parts) - 1} more" if len(parts) > 1 else ""
    return f"no {what} is known of {parts[0]}{more}"


def _taken(plan: MountPlan, bill: Bill) -> str:
    """What all weighs with the masses that were taken where none is known."""
    if not plan.stances or not bill.without_mass:
        return ""
    mass_kg = sum(stance.mass_kg for stance in plan.stances)
    return f"; {mass_kg:.1f} kg with what is taken for it, as the notes say"


def _structure() -> str:
    words = (
        "<b>Drag to turn, scroll to zoom.</b> Point at a part to read its name. Entries of the "
        "legend switch kinds of parts on and off. The slider draws the rig apart."
    )
    slider = (
        '<label class="apart">Draw apart <input type="range" id="apart" min="0" max="100" '
        'value="0" step="1"></label>'
    )
    return section("structure", "Structure", words, slider, plot(FIGURE, "", "large"))


def _accuracy(plan: MountPlan) -> str:
    price = plan.price
    stages = (("Designed", price.designed), ("Rounded", price.rounded), ("Built", price.built))
    rows = [
        (
            name,
            figure_text(f.sigma_median_mm),
            figure_text(f.sigma_p95_mm),
            percent(f.coverage_2_views),
            percent(f.coverage_3_views),
            "all hold" if f.feasible else long_words(_broken(f)),
        )
        for name, f in stages
    ]
    head = ("", "σ median mm", "σ 95 % mm", "Two views", "Three views", "Limits")
    words = (
        "The design; its settings rounded one by one to what can be set; and what is built: "
        "rounded with the other settings optimised again after each."
    )
    return section("accuracy", "What rounding costs", words, table(head, rows))


def _broken(figures: Figures) -> str:
    if not figures.broken:
        return "broken"
    return f"{len(figures.broken)} broken: {of_limits(figures.broken)}"


def _settings(plan: MountPlan) -> str:
    words = (
        "What is set on each camera; what is more or less for the rig's weight is in it. In "
        "brackets how far one setting may be off, alone, before a limit breaks. The setting "
        "sheets say where each is measured from."
    )
    found = {(t.camera, t.setting): t for t in plan.tolerances}
    sinking = {sag.camera: sag for sag in plan.sags}

    def cell(mount: CameraMount, k: int) -> str:
        if k >= len(mount.settings):
            return ""
        s = mount.settings[k]
        unit = "°" if s.unit == "deg" else " mm"
        tolerance = found.get((mount.name, s.name))
        told = set_for_weight(s, sinking.get(mount.name))
        more = told.value - s.value
        slack = ""
        if tolerance is not None:
            near = min(abs(tolerance.plus), abs(tolerance.minus))
            slack = f" <small>({figure_text(near, 2)})</small>"
        if more:
            way = "more" if more > 0.0 else "less"
            slack += f"<br><small>{abs(more):g} {way} for its weight</small>"
        return f"{esc(s.name)} <b>{esc(setting_text(told))}</b>{unit}{slack}"

    most = max((len(m.settings) for m in plan.mounts), default=0)
    rows = [(esc(m.name), *(cell(m, k) for k in range(most))) for m in plan.mounts]
    poses = [tuple(map(esc, pose_figures(m.camera, plan.datum_rig_mm))) for m in plan.mounts]
    return section(
        "settings",
        "Settings",
        words,
        table(("Camera", *[""] * most), rows),
        "<h3>Poses, optical centre from the datum</h3>",
        table(tuple(map(esc, POSE_COLUMNS)), poses),
    )


def _parts(bill: Bill) -> str:
    rows = [
        (
            esc(line.name),
            esc(line.part),
            str(line.quantity),
            "" if line.length_mm is None else _apart(line.length_mm),
            "–" if line.mass_g is None else f"{line.mass_g:.0f}",
            "–" if line.cost is None else f"{line.cost:.2f}",
            esc(line.note),
        )
        for line in bill.lines
    ]
    cost = "–" if bill.cost is None else f"{bill.cost:.2f}"
    rows.append(("<b>Sum of what is known</b>", "", "", "", f"{bill.mass_g:.0f}", cost, ""))
    currency = f" {esc(bill.currency)}" if bill.currency and bill.cost is not None else ""
    head = ("Part", "Id", "Count", "Length mm", "Mass g", f"Cost{currency}", "")
    words = "What to buy and to make. Figures that nobody published are left out of the sums."
    return section("parts", "Parts", words, table(head, rows))


def _apart(length_mm: float) -> str:
    """A length with its thousands apart; tenths only where there are any."""
    return f"{length_mm:,.1f}".removesuffix(".0").replace(",", "\u202f")


def _cuts(cuts: tuple[Cut, ...]) -> str:
    if not cuts:
        return section("cuts", "Cut list", "Nothing has to be cut.")
    rows = [
        (esc(c.name), esc(c.role), mm(c.length_mm), str(c.quantity), esc(", ".join(c.members)))
        for c in cuts
    ]
    return section(
        "cuts", "Cut list", "", table(("Profile", "For", "Length mm", "Count", "Members"), rows)
    )


def _step(step: str) -> str:
    """A step; one of several pieces as a list of them."""
    head, colon, rest = step.partition(": ")
    pieces = rest.rstrip(".").split("; ")
    if not colon or len(pieces) < LISTED_FROM:
        return element("li", esc(step))
    below = "".join(element("li", esc(piece)) for piece in pieces)
    return f"<li>{esc(head)}:<ul>{below}</ul></li>"


def _steps(plan: MountPlan) -> str:
    steps = "".join(_step(step) for step in plain_steps(plan))
    notes = "".join(element("li", esc(note)) for note in plan.notes)
    clashes = "".join(
        f"<li>{esc(c.one)} and {esc(c.other)} ({esc(c.kind)}): {figure_text(c.clearance_mm)} mm, "
        f"asked for {figure_text(c.required_mm)} mm</li>"
        for c in plan.clashes
    )
    content = f'<ol class="steps">{steps}</ol>'
    content += f"<h3>Notes</h3><ul class='notes'>{notes}</ul>" if notes else ""
    content += f'<h3>Clashes</h3><ul class="notes warning">{clashes}</ul>' if clashes else ""
    return section("steps", "Assembly steps", "", content)
