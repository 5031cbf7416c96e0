"""The page: sections in order, texts, figures, and everything inlined into one file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from geometry.scan import ScanNote
from geometry.subject import Subject
from rig.figures import number
from rig.layout import Layout
from rig.report import sections
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
from rig.report.markup import esc
from rig.report.rigview import rig_figure
from rig.report.surface import RegionLookup, view_mesh
from solver.result import Design

if TYPE_CHECKING:
    import plotly.graph_objects as go

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)
"""The page loads nothing from anywhere; plotly compiles its shaders' glue, hence eval."""

SMALL_HEAD_FACES = 9_000


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
    figures = _figures(design, subject, layout)
    body = "".join(
        (
            sections.verdict(design, layout),
            sections.tiles(design, layout),
            sections.rig(),
            sections.accuracy(design),
            sections.ellipsoids(design, figures.before, figures.after, figures.factor),
            sections.footprints(design, subject),
            sections.limits(design),
            sections.cameras(design),
            sections.mounts(design, layout, subject),
            sections.solver(design),
            sections.scan(notes, scan_name),
        )
    )
    summary = {
        "cameras": len(design.cameras),
        "ellipsoids": len(figures.after.rows),
        "ellipsoids_before": len(figures.before.rows),
        "triangles": figures.triangles,
        "limits": len(design.quality.constraints),
        "sigma_median_mm": number(design.quality.sigma_median_mm),
    }
    return _document(title, scan_name, design, body, figures.plots, summary)


def _figures(design: Design, subject: Subject, layout: Layout) -> _Figures:
    before, after = design.start_quality.points, design.quality.points
    lookup = RegionLookup(after)
    mesh = view_mesh(subject, lookup)
    small = view_mesh(subject, lookup, SMALL_HEAD_FACES)
    limits = sigma_range_mm(after)
    radius = after.points.radius_mm
    factor = exaggeration(after, radius)
    sample = spread_sample(after.points.points_mm, SHOWN)
    same = before.points is after.points or len(before.sigma_mm) == len(after.sigma_mm)
    earlier = sample if same else spread_sample(before.points.points_mm, SHOWN)
    drawn_before = ellipsoids(before, earlier, factor, LARGEST_SHARE * radius)
    drawn_after = ellipsoids(after, sample, factor, LARGEST_SHARE * radius)
    plots = {
        "rig-3d": rig_figure(design, mesh, layout, limits),
        **error_maps(subject, before, after),
        "ellipsoids-before": ellipsoid_figure(small, before, drawn_before, limits),
        "ellipsoids-after": ellipsoid_figure(small, after, drawn_after, limits),
    }
    return _Figures(plots, drawn_before, drawn_after, factor, len(mesh.faces))


def _document(
    title: str,
    scan_name: str,
    design: Design,
    body: str,
    plots: dict[str, Any],
    summary: dict[str, Any],
) -> str:
    # Imported here: plotly costs a second, and only a report needs it.
    from plotly.offline import get_plotlyjs

    here = files("rig.report")
    style = here.joinpath("style.css").read_text(encoding="utf-8")
    script = here.joinpath("page.js").read_text(encoding="utf-8")
    data = (
        "{"
        + ",".join(f"{json.dumps(key)}:{_figure_json(plot)}" for key, plot in plots.items())
        + "}"
    )
    view = esc(json.dumps(summary, allow_nan=False))
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{POLICY}">
<meta name="generator" content="Rigwright">
<title>{esc(title)}</title>
<link rel="icon" href="data:,">
<style>{style}</style>
</head>
<body data-view="{view}">
<header>{sections.heading(title, scan_name, design)}</header>
<main>{body}</main>
<footer>{sections.colophon(design)}</footer>
<script>{get_plotlyjs()}</script>
<script type="application/json" id="figures">{data}</script>
<script>{script}</script>
</body>
</html>
"""


def _figure_json(plot: go.Figure) -> str:
    """A figure as JSON that may stand inside a script element, whatever names it holds."""
    # The default template would double the page's figures with styles the page overrides.
    plot.update_layout(template="none")
    return (
        str(plot.to_json()).replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    )
