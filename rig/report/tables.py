"""The tables of the report."""

from __future__ import annotations

import numpy as np

from common.page.html import element, esc, figure_text, long_words, percent, table
from geometry.arrays import Floats
from rig.design.layout import Layout, Neighbour
from rig.report.words import family_words
from solver.result import ConstraintRow, Design, Quality, Sense, SolverReport

SENSES = {Sense.AT_MOST: "≤", Sense.AT_LEAST: "≥", Sense.EQUAL: "="}
SHOWN_ROWS = 40
"""Limits that are open to the eye at once; the rest is one click away."""


def constraint_table(rows: tuple[ConstraintRow, ...]) -> str:
    """All limits: the broken first, then those that bind, then the others folded away."""
    broken = sorted((r for r in rows if not r.satisfied), key=lambda r: r.slack)
    binding = [r for r in rows if r.satisfied and r.active]
    others = [r for r in rows if r.satisfied and not r.active]
    first = broken + binding
    html = (
        _constraints(first[:SHOWN_ROWS]) if first else "<p>No limit is broken and none binds.</p>"
    )
    if first[SHOWN_ROWS:]:
        html += _folded(
            f"{len(first) - SHOWN_ROWS} more that bind", _constraints(first[SHOWN_ROWS:])
        )
    if others:
        html += _folded(f"{len(others)} limits that hold with room to spare", _constraints(others))
    return html


def _folded(title: str, content: str) -> str:
    return f"<details><summary>{esc(title)}</summary>{content}</details>"


def _constraints(rows: list[ConstraintRow]) -> str:
    cells, css = [], []
    for row in rows:
        state = "holds"
        if not row.satisfied:
            state = "broken"
        elif row.active:
            state = "binds"
        title, words = family_words(row.family)
        who = "" if row.subject in (row.family, "all") else row.subject
        subject = f' <span class="who">{esc(who)}</span>' if who else ""
        unit = f" {esc(row.unit)}" if row.unit else ""
        cells.append(
            (
                element("span", esc(title), title=words) + subject,
                figure_text(row.value, 4) + unit,
                _asked(row) + unit,
                figure_text(_without_rounding(row.slack, max(abs(row.limit), abs(row.value))))
                + unit,
                f'<span class="badge {state}">{state}</span>',
            )
        )
        css.append(state)
    return table(("Limit", "Value", "Asked for", "Slack", "State"), cells, row_css=css)


def _asked(row: ConstraintRow) -> str:
    """Sense and limit; an equality with its tolerance, which slack and deviation add up to."""
    words = f"{SENSES[row.sense]} {figure_text(row.limit, 4)}"
    tolerance = _without_rounding(row.slack + abs(row.value - row.limit), row.limit)
    banded = row.sense is Sense.EQUAL and tolerance > 0.0
    return f"{words} ± {figure_text(tolerance)}" if banded else words


def _without_rounding(value: float, scale: float) -> float:
    """Zero for what is only rounding beside ``scale``."""
    return 0.0 if abs(value) <= 1e-6 * max(abs(scale), 1e-3) else value


def camera_table(design: Design) -> str:
    """What each camera sees and how."""
    figures, rows = design.quality.cameras, []
    for i, camera in enumerate(design.cameras):
        gsd, incidence, depth, focus = (
            figures.gsd_mm[i],
            figures.incidence_deg[i],
            figures.depth_mm[i],
            figures.focus_mm[i],
        )
        rows.append(
            (
                esc(camera.name) + (" <small>fixed</small>" if camera.fixed else ""),
                str(int(figures.points_seen[i])),
                figure_text(figures.distance_mm[i], 4),
                figure_text(camera.focus_distance_mm, 4),
                _span(depth, 4),
                _span(focus, 4),
                f"{figure_text(gsd[1])} <small>({_span(gsd[[0, 2]])})</small>",
                f"{figure_text(incidence[0])}° <small>(max {figure_text(incidence[1])}°)</small>",
            )
        )
    head = (
        "Camera",
        "Points seen",
        "Distance mm",
        "Focus mm",
        "Points lie at mm",
        "Sharp from – to mm",
        "GSD mm",
        "Incidence",
    )
    return table(head, rows)


def _span(ends: Floats, digits: int = 3) -> str:
    return f"{figure_text(ends[0], digits)} – {figure_text(ends[1], digits)}"


def coverage_table(design: Design) -> str:
    """Share of the region by number of views, before and after."""
    before = {c.views: c.share for c in design.start_quality.coverage}
    rows = [
        (f"{c.views} or more", percent(before.get(c.views, float("nan"))), percent(c.share))
        for c in design.quality.coverage
    ]
    rows += [
        (
            "of the views: sharp",
            percent(design.start_quality.in_focus_share),
            percent(design.quality.in_focus_share),
        ),
        (
            "of the views: in frame",
            percent(design.start_quality.in_frame_share),
            percent(design.quality.in_frame_share),
        ),
    ]
    return table(("Views of a point", "Start", "Design"), rows, css="narrow")


def accuracy_table(design: Design) -> str:
    """Sigma and cost, before and after."""
    before, after = design.start_quality, design.quality
    figures = (
        ("σ median, mm", before.sigma_median_mm, after.sigma_median_mm),
        ("σ 95 % of points below, mm", before.sigma_p95_mm, after.sigma_p95_mm),
        ("σ largest, mm", before.sigma_max_mm, after.sigma_max_mm),
        ("mean |Q|, mm² (Eq 7)", before.cost_mm2, after.cost_mm2),
    )
    rows = [(esc(name), figure_text(b), figure_text(a), _ratio(a, b)) for name, b, a in figures]
    return table(("", "Start", "Design", "Ratio"), rows, css="narrow")


def _ratio(after: float, before: float) -> str:
    return figure_text(after / before) if before > 0.0 and np.isfinite(after / before) else "–"


def pair_table(design: Design, values: Floats, unit: str) -> str:
    """A symmetric table of camera pairs, shaded by value."""
    names = [camera.name for camera in design.cameras]
    pairs = values[~np.eye(len(values), dtype=bool)]
    known = pairs[np.isfinite(pairs)]
    top = float(known.max()) if len(known) and known.max() > 0.0 else 1.0
    rows = []
    for i, name in enumerate(names):
        cells = [f"<b>{esc(name)}</b>"]
        for j in range(len(names)):
            if i == j:
                cells.append('<span class="none"></span>')
                continue
            share = max(0.0, min(1.0, values[i, j] / top)) if np.isfinite(values[i, j]) else 0.0
            cells.append(
                f'<span class="heat" style="--heat:{share:.2f}">{figure_text(values[i, j])}</span>'
            )
        rows.append(cells)
    return table((esc(unit), *(esc(name) for name in names)), rows, css="pairs")


def starts_table(solver: SolverReport) -> str:
    """How the starts went; the best feasible one won."""
    rows, css = [], []
    for start in solver.starts:
        rows.append(
            (
                str(start.index + 1),
                esc(start.kind),
                "yes" if start.feasible else "no",
                figure_text(start.cost_mm2, 4),
                figure_text(start.violation, 2),
                str(start.iterations),
                str(start.rounds),
                long_words(start.why_stopped),
            )
        )
        css.append("")
    feasible = [i for i, s in enumerate(solver.starts) if s.feasible]
    if feasible:
        css[min(feasible, key=lambda i: solver.starts[i].cost_mm2)] = "best"
    head = (
        "Start",
        "Kind",
        "All limits hold",
        "Mean |Q| mm²",
        "Breach",
        "Iterations",
        "Rounds",
        "Why it stopped",
    )
    return table(head, rows, row_css=css)


def conflict_table(solver: SolverReport) -> str:
    """Limits that contradict each other and by how much each would have to give way."""
    rows = []
    for conflict in solver.conflicts:
        title, words = family_words(conflict.family)
        unit = f" {esc(conflict.unit)}" if conflict.unit else ""
        alone = (
            "is not enough"
            if conflict.amount_alone is None
            else figure_text(conflict.amount_alone) + unit
        )
        rows.append(
            (element("span", esc(title), title=words), figure_text(conflict.amount) + unit, alone)
        )
    return table(
        ("Limit", "Gives way in the nearest design by", "It alone would have to by"),
        rows,
        css="narrow",
    )


def layout_table(layout: Layout) -> str:
    """What a builder sets for each camera."""
    rows = []
    for placement in layout.placements:
        across, back, up = placement.from_datum_mm
        pan, tilt, roll = placement.pan_tilt_roll_deg
        rows.append(
            (
                esc(placement.camera.name),
                *(_tenths(v) for v in (across, back, up)),
                *(f"{_tenths(v)}°" for v in (pan, tilt, roll)),
                f"{placement.tape_mm:.1f}",
                _neighbour(placement.nearest_body),
                _neighbour(placement.nearest_to_view),
            )
        )
    head = (
        "Camera",
        "Across mm",
        "Back mm",
        "Up mm",
        "Pan",
        "Tilt",
        "Roll",
        "Tape to lens mm",
        "Nearest body",
        "Nearest to its view",
    )
    return table(head, rows)


def _tenths(value: float) -> str:
    """One decimal, without the minus sign of a rounded zero."""
    return f"{round(float(value), 1) + 0.0:.1f}".replace("-", "−")


def _neighbour(neighbour: Neighbour | None) -> str:
    if neighbour is None:
        return "–"
    return f"{figure_text(neighbour.clearance_mm)} mm <small>{esc(neighbour.name)}</small>"


def share_seen(quality: Quality, views: int) -> float:
    """Share of points with so many views or more; NaN when the figures do not say."""
    return next((c.share for c in quality.coverage if c.views == views), float("nan"))
