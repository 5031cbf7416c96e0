"""The subject in the main figure, coloured by sigma."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import Ints
from rig.report.colours import GOOD_TO_BAD, SKIN
from rig.report.surface import ViewMesh
from rig.report.three import LAMP, SOFT, mesh_trace, placed, valued
from solver.result import PointTable

if TYPE_CHECKING:
    import plotly.graph_objects as go

HOVER = "%{text}<extra></extra>"
BAR = {
    "title": {"text": "σ mm", "side": "top"},
    "orientation": "h",
    "thickness": 10,
    "len": 0.42,
    "x": 0.0,
    "xanchor": "left",
    "y": 1.0,
    "yanchor": "top",
    "outlinewidth": 0,
    "nticks": 5,
}


def subject_traces(
    mesh: ViewMesh, table: PointTable, limits: tuple[float, float]
) -> list[go.Mesh3d | go.Scatter3d]:
    """The mesh with its region coloured by sigma, or the bare points when there is no mesh."""
    colours = {"colorscale": GOOD_TO_BAD, "cmin": limits[0], "cmax": limits[1], "colorbar": BAR}
    if len(mesh.faces) == 0:
        return [_points(table, colours)]
    rest = mesh.faces[~mesh.in_region]
    traces = []
    if len(rest):
        traces.append(mesh_trace(mesh.vertices_mm, rest, SKIN, "head", hoverinfo="skip"))
    if mesh.in_region.any():
        traces.append(_region(mesh, table, colours))
    return traces


def _points(table: PointTable, colours: dict[str, Any]) -> go.Scatter3d:
    import plotly.graph_objects as go

    x, y, z = table.points.points_mm.T
    marker = {"size": 5, "color": table.sigma_mm, **colours}
    words = {"text": _words(table), "hovertemplate": HOVER}
    return go.Scatter3d(
        x=x, y=y, z=z, mode="markers", marker=marker, name="points", showlegend=False, **words
    )


def _region(mesh: ViewMesh, table: PointTable, colours: dict[str, Any]) -> go.Mesh3d:
    import plotly.graph_objects as go

    used, faces = _only_used(mesh.faces[mesh.in_region])
    nearest = mesh.nearest[used]
    words = _words(table)
    x, y, z = placed(mesh.vertices_mm[used]).T
    i, j, k = faces.T.astype(np.uint16 if len(used) < 65_536 else np.uint32)
    return go.Mesh3d(
        x=x,
        y=y,
        z=z,
        i=i,
        j=j,
        k=k,
        intensity=valued(table.sigma_mm[nearest]),
        text=[words[n] for n in nearest],
        hovertemplate=HOVER,
        lighting=SOFT,
        lightposition=LAMP,
        name="region",
        showscale=True,
        **colours,
    )


def _words(table: PointTable) -> list[str]:
    return [f"σ {s:.3f} mm, {v} views" for s, v in zip(table.sigma_mm, table.views, strict=True)]


def _only_used(faces: Ints) -> tuple[Ints, Ints]:
    used, renumbered = np.unique(faces, return_inverse=True)
    return used.astype(np.int64), renumbered.reshape(faces.shape).astype(np.int64)
