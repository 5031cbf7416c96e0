"""The error map on the head, seen from the front."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import Floats
from geometry.subject import Subject
from rig.report.colours import GOOD_TO_BAD, VIEW_STEPS
from rig.report.surface import FrontView, RegionLookup, front_view
from rig.report.three import valued
from solver.result import PointTable

if TYPE_CHECKING:
    import plotly.graph_objects as go

SHADES = 255
"""Shades are bytes from 1 to this, a quarter of the size of floats; 0 is where nothing is."""

NOTHING = [[0.0, "rgba(0,0,0,0)"], [0.5 / SHADES, "rgba(0,0,0,0)"]]
SHADE_SCALE = [
    *NOTHING,
    [0.5 / SHADES, "rgba(0,0,0,0)"],
    [0.3, "rgba(0,0,0,0.05)"],
    [1.0, "rgba(0,0,0,0.62)"],
]
GREY_SCALE = [*NOTHING, [0.5 / SHADES, "#b9bcc4"], [1.0, "#b9bcc4"]]


def sigma_range_mm(table: PointTable) -> tuple[float, float]:
    """Colour range for all figures: the design's own spread, so that its pattern shows.

    Points with fewer than two views are not measured at all; their prior would take the scale.
    """
    sigma = table.sigma_mm[np.isfinite(table.sigma_mm) & (table.views >= 2)]
    if len(sigma) == 0:
        return 0.0, 1.0
    low, high = np.percentile(sigma, [1.0, 98.0])
    return float(low), float(max(high, low * 1.05 + 1e-12))


def error_maps(subject: Subject, before: PointTable, after: PointTable) -> dict[str, go.Figure]:
    """Figures by the key of their place: sigma before and after, views after."""
    limits = sigma_range_mm(after)
    if len(subject.occluder.faces) == 0:
        return {
            "map-before": _dots(before, before.sigma_mm, limits),
            "map-after": _dots(after, after.sigma_mm, limits),
            "map-views": _dots(after, after.views.astype(float), None),
        }
    lookup = RegionLookup(after)
    view = front_view(subject.occluder, after, lookup)
    earlier = (
        view
        if before.points is after.points
        else front_view(subject.occluder, before, RegionLookup(before))
    )
    return {
        "map-before": _map(earlier, before.sigma_mm, limits),
        "map-after": _map(view, after.sigma_mm, limits),
        "map-views": _map(view, after.views.astype(float), None),
    }


def _scale(limits: tuple[float, float] | None) -> dict[str, Any]:
    """Colour scale of sigma, or the steps of the views when ``limits`` is None."""
    bar: dict[str, Any] = {"thickness": 10, "len": 0.85, "outlinewidth": 0}
    if limits is not None:
        bar["title"] = {"text": "σ mm", "side": "top"}
        return {"colorscale": GOOD_TO_BAD, "cmin": limits[0], "cmax": limits[1], "colorbar": bar}
    count = len(VIEW_STEPS)
    steps = [[(k + e) / count, colour] for k, colour in enumerate(VIEW_STEPS) for e in (0, 1)]
    labels = [str(k) for k in range(count - 1)] + [f"{count - 1}+"]
    bar |= {
        "title": {"text": "views", "side": "top"},
        "tickvals": list(range(count)),
        "ticktext": labels,
    }
    return {"colorscale": steps, "cmin": -0.5, "cmax": count - 0.5, "colorbar": bar}


def _map(view: FrontView, values: Floats, limits: tuple[float, float] | None) -> go.Figure:
    import plotly.graph_objects as go

    on_region = view.nearest >= 0
    shown = np.where(on_region, values[np.maximum(view.nearest, 0)], np.nan)
    scale = _scale(limits)
    place = {"x": view.x_mm.round(2), "y": view.z_mm.round(2)}
    word = "σ %{z:.3f} mm" if limits is not None else "%{z:.0f} views"
    skin = np.where(view.on_subject, 1, 0).astype(np.uint8)
    shade = np.where(view.on_subject, 1.0 + np.round(view.shade * (SHADES - 1)), 0).astype(np.uint8)
    under = {"zmin": 0, "zmax": SHADES, "showscale": False, "hoverinfo": "skip"}
    figure = go.Figure(
        [
            go.Heatmap(z=skin, **place, **under, colorscale=GREY_SCALE),
            go.Heatmap(
                z=valued(shown),
                **place,
                colorscale=scale["colorscale"],
                zmin=scale["cmin"],
                zmax=scale["cmax"],
                colorbar=scale["colorbar"],
                hovertemplate=f"{word}<extra></extra>",
            ),
            go.Heatmap(z=shade, **place, **under, colorscale=SHADE_SCALE),
        ]
    )
    return _flat(figure)


def _dots(table: PointTable, values: Floats, limits: tuple[float, float] | None) -> go.Figure:
    import plotly.graph_objects as go

    points, scale = table.points.points_mm, _scale(limits)
    word = "σ %{marker.color:.3f} mm" if limits is not None else "%{marker.color:.0f} views"
    marker = {
        "size": 9,
        "color": values,
        **scale,
        "line": {"width": 1, "color": "rgba(128,128,128,.6)"},
    }
    figure = go.Figure(
        go.Scatter(
            x=points[:, 0],
            y=points[:, 2],
            mode="markers",
            marker=marker,
            hovertemplate=f"{word}<extra></extra>",
        )
    )
    return _flat(figure)


def _flat(figure: go.Figure) -> go.Figure:
    axis = {"showgrid": False, "zeroline": False, "ticks": "", "showticklabels": False}
    figure.update_layout(
        xaxis={**axis, "constrain": "domain"},
        yaxis={**axis, "scaleanchor": "x", "constrain": "domain"},
        margin={"l": 4, "r": 4, "t": 8, "b": 4},
        showlegend=False,
    )
    return figure
