"""The page: sections in order, texts, figures, and everything inlined into one file."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from common.files.plain import number
from common.page.document import drawn_page, pack_ahead, style_sheet
from common.page.still import still_picture
from geometry.scan import ScanNote
from geometry.subject import Subject
from rig.design.layout import Layout
from rig.report import sections, summary
from rig.report.ellipsoids import (
    LARGEST_SHARE,
    SHOWN,
    Ellipsoids,
    ellipsoid_figure,
    ellipsoids,
    exaggeration,
    spread_sample,
)
from rig.report.errormap import error_maps, sigma_range_mm
from rig.report.rigview import rig_figure
from rig.report.surface import RegionLookup, view_mesh
from solver.result import Design

if TYPE_CHECKING:
    import plotly.graph_objects as go

SMALL_HEAD_FACES = 6_000
_SCENES = ("rig-3d", "ellipsoids-before", "ellipsoids-after")
_DRAWERS = 2
"""Threads that draw still pictures: half of the work is the image library's, beside Python."""


@dataclass(frozen=True)
class _Figures:
    """Plotly figures by the key of their place, and what the texts say about them."""

    plots: dict[str, go.Figure]
    before: Ellipsoids
    after: Ellipsoids
    factor: float
    triangles: int


def render_report(
    design: Design,
    subject: Subject,
    layout: Layout,
    *,
    title: str = "Rig design",
    scan_name: str = "",
    notes: tuple[ScanNote, ...] = (),
) -> str:
    """The report as one HTML document that needs no network.

    ``title`` and ``scan_name`` may hold anything: they are escaped. ``document.body.dataset``
    gets ``view``, a JSON summary of what is drawn, and ``ready`` once the figures stand.
    """
    pack_ahead()
    figures = _figures(design, subject, layout)
    return drawn_page(
        title,
        header=summary.heading(title, scan_name, design),
        main=_main(design, subject, layout, figures, notes, scan_name),
        footer=sections.colophon(design),
        style=style_sheet(),
        figures=_figures_json(figures.plots),
        script=files("rig.report").joinpath("page.js").read_text(encoding="utf-8"),
        view=_view(design, figures),
    )


def _main(
    design: Design,
    subject: Subject,
    layout: Layout,
    figures: _Figures,
    notes: tuple[ScanNote, ...],
    scan_name: str,
) -> str:
    """All sections in their order."""
    with ThreadPoolExecutor(_DRAWERS, thread_name_prefix="still") as drawers:
        drawn = drawers.map(still_picture, [figures.plots[key] for key in _SCENES])
        stills = dict(zip(_SCENES, drawn, strict=True))
    parts = (
        summary.verdict(design, layout),
        summary.tiles(design, layout),
        sections.rig(stills),
        sections.accuracy(design),
        sections.ellipsoids(design, figures.before, figures.after, figures.factor, stills),
        sections.footprints(design, subject),
        sections.limits(design),
        sections.cameras(design),
        sections.mounts(design, layout, subject),
        sections.solver(design),
        sections.scan(notes, scan_name),
    )
    return "".join(parts)


def _view(design: Design, figures: _Figures) -> dict[str, Any]:
    """What is drawn, in numbers: lets a test, or a reader's script, check the page."""
    return {
        "cameras": len(design.cameras),
        "ellipsoids": len(figures.after.rows),
        "ellipsoids_before": len(figures.before.rows),
        "triangles": figures.triangles,
        "limits": len(design.quality.constraints),
        "sigma_median_mm": number(design.quality.sigma_median_mm),
    }


def _figures(design: Design, subject: Subject, layout: Layout) -> _Figures:
    before, after = design.start_quality.points, design.quality.points
    lookup = RegionLookup(after)
    mesh = view_mesh(subject, lookup)
    small = view_mesh(subject, lookup, SMALL_HEAD_FACES)
    limits = sigma_range_mm(after)
    radius = after.points.radius_mm
    factor = exaggeration(after, radius)
    sample = spread_sample(after.points.points_mm, SHOWN)
    drawn_before = ellipsoids(before, sample, factor, LARGEST_SHARE * radius)
    drawn_after = ellipsoids(after, sample, factor, LARGEST_SHARE * radius)
    plots = {
        "rig-3d": rig_figure(design, mesh, layout, limits),
        **error_maps(subject, before, after),
        "ellipsoids-before": ellipsoid_figure(small, before, drawn_before, limits),
        "ellipsoids-after": ellipsoid_figure(small, after, drawn_after, limits),
    }
    return _Figures(plots, drawn_before, drawn_after, factor, len(mesh.faces))


def _figures_json(plots: dict[str, go.Figure]) -> str:
    """The figures as JSON, by the key of their place."""
    parts = []
    for key, plot in plots.items():
        # The default template would double the figures with styles the page overrides.
        plot.update_layout(template="none")
        parts.append(f"{json.dumps(key)}:{plot.to_json()}")
    return "{" + ",".join(parts) + "}"
