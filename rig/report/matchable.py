"""What dense matching can make of a design, as the report tells it."""

from __future__ import annotations

from common.page.html import element, esc, figure_text, percent
from rig.report import tables
from solver.matching import Matching
from solver.result import Design


def matchable(design: Design) -> str:
    """Points in matchable pairs, groups of cameras, and who shares how much with whom."""
    found = design.quality.matchable
    words = (
        f"{_criteria(design.limits.matching)} Of the points that can be matched at all "
        f"({percent(found.reachable_share)}), {percent(found.share(1))} are in such a pair and "
        f"{percent(found.share(2))} in two or more. {_grouped(design)}"
    )
    shares = tables.pair_table(design, 100.0 * found.shared, "%")
    return element("h3", "Points that pairs can match, %") + element("p", esc(words)) + shares


def _criteria(matching: Matching) -> str:
    angle, steep = figure_text(matching.max_angle_deg), figure_text(matching.max_incidence_deg)
    return (
        "Two cameras can match a point that both have sharp in their frame, with rays at most "
        f"{angle}° apart and {steep}° from its normal, where a pixel of the one is at most "
        f"{figure_text(matching.max_scale_ratio)} times as large as one of the other."
    )


def _grouped(design: Design) -> str:
    groups = design.quality.matchable.groups
    if len(groups) == 1:
        return "All cameras hang together by the surface that they share."
    names = "; ".join(", ".join(design.cameras[k].name for k in group) for group in groups)
    return f"By the surface that they share the cameras are {len(groups)} groups: {names}."
