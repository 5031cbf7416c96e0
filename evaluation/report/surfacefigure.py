"""The measured surface as a figure that turns: in its colours, or by its sigma."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evaluation.reconstruction.surface import SurfaceMesh
from rig.report.three import lines_trace, mesh_trace, scene_layout

if TYPE_CHECKING:
    import plotly.graph_objects as go

RIM_COLOUR = "#d02c2c"
SIGMA_SCALE = ((0.0, "#289646"), (0.5, "#f0cd3c"), (1.0, "#cd2d28"))
"""Green, yellow, red: as the pictures of the points have it."""


def surface_figure(mesh: SurfaceMesh, scale_mm: float) -> go.Figure:
    """Three traces: colours, sigma from 0 to ``scale_mm`` (hidden at first), rims of holes."""
    import plotly.graph_objects as go

    painted = [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in mesh.colours.tolist()]
    flat = {"hoverinfo": "skip", "flatshading": False}
    colours = mesh_trace(
        mesh.vertices_mm, mesh.faces, "#c8b4a8", "colours", vertexcolor=painted, **flat
    )
    sigma = mesh_trace(
        mesh.vertices_mm, mesh.faces, "#c8b4a8", "sigma", visible=False,
        intensity=mesh.sigma_mm.astype(np.float32), cmin=0.0, cmax=scale_mm,
        colorscale=SIGMA_SCALE, colorbar={"title": {"text": "sigma, mm"}, "len": 0.6},
        hovertemplate="sigma %{intensity:.3f} mm<extra></extra>",
    )  # fmt: skip
    rims = lines_trace(mesh.vertices_mm[mesh.rims()], RIM_COLOUR, "rims", width_px=4.0)
    figure = go.Figure([colours, sigma, rims], scene_layout(1.0, axes=False, aim_z=0.0))
    buttons = [
        {"label": "Colours", "method": "restyle", "args": [{"visible": [True, False, True]}]},
        {"label": "Sigma", "method": "restyle", "args": [{"visible": [False, True, True]}]},
    ]
    menu = {"type": "buttons", "direction": "right", "x": 0.0, "xanchor": "left", "y": 1.0}
    figure.update_layout(showlegend=False, updatemenus=[menu | {"buttons": buttons}])
    return figure
