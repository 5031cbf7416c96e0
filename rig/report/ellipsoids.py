"""Error ellipsoids before and after, drawn large enough to see."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Floats, Ints
from rig.report.colours import GOOD_TO_BAD, SKIN
from rig.report.surface import ViewMesh
from rig.report.three import mesh_trace, placed, scene_layout, valued
from solver.result import PointTable

if TYPE_CHECKING:
    import plotly.graph_objects as go

SHOWN = 120
"""Ellipsoids per figure: enough for the pattern, few enough to tell apart."""

TYPICAL_SHARE = 0.04
"""Drawn length of the median ellipsoid as a share of the region's radius."""

LARGEST_SHARE = 0.30
"""Longest drawn semi-axis as a share of the region's radius; longer ones are cut, and counted."""


@dataclass(frozen=True, eq=False)
class Ellipsoids:
    """What one figure shows.

    ``rows`` (k,) are the points drawn as ellipsoids, ``axes`` (k, 3, 3) their drawn semi-axes as
    columns, millimetres. ``lost`` (m,) are sampled points with fewer than two views, which have
    no ellipsoid. ``cut`` counts the ellipsoids drawn smaller than they are.
    """

    rows: Ints
    axes: Floats
    lost: Ints
    cut: int


def spread_sample(points: Floats, count: int) -> Ints:
    """Indices of ``count`` points (N, 3) spread evenly: each next one is farthest from the rest."""
    count = min(count, len(points))
    first = int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    chosen, gap = [first], np.linalg.norm(points - points[first], axis=1)
    for _ in range(count - 1):
        chosen.append(int(np.argmax(gap)))
        gap = np.minimum(gap, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen, dtype=np.int64)


def exaggeration(table: PointTable, radius_mm: float) -> float:
    """A round factor (1, 2 or 5 times a power of ten) that makes the ellipsoids visible."""
    typical = float(np.median(table.sigma_mm))
    if not typical > 0.0:
        return 1.0
    wanted = np.log10(TYPICAL_SHARE * radius_mm / typical)
    steps = [step * 10.0 ** (np.floor(wanted)) for step in (1.0, 2.0, 5.0, 10.0)]
    return float(min(steps, key=lambda step: abs(np.log10(step) - wanted)))


def ellipsoids(table: PointTable, sample: Ints, factor: float, largest_mm: float) -> Ellipsoids:
    """The ellipsoids of the sampled points, ``factor`` times too large."""
    usable = (table.views[sample] >= 2) & np.isfinite(table.sigma_mm[sample])
    rows = sample[usable]
    variance, directions = np.linalg.eigh(table.covariance_mm2[rows])
    lengths = np.sqrt(np.maximum(variance, 0.0)) * factor
    longest = lengths.max(axis=1, initial=0.0)
    shrink = np.minimum(1.0, largest_mm / np.maximum(longest, 1e-300))
    axes = directions * (lengths * shrink[:, None])[:, None, :]
    return Ellipsoids(rows, axes, sample[~usable], int((shrink < 1.0).sum()))


def ellipsoid_figure(
    mesh: ViewMesh, table: PointTable, shown: Ellipsoids, limits: tuple[float, float]
) -> go.Figure:
    """Ellipsoids on the subject; dots where fewer than two cameras see the point."""
    import plotly.graph_objects as go

    figure = go.Figure()
    low, high = _surroundings(table)
    near = _near_region(mesh, low, high)
    if len(near):
        figure.add_trace(mesh_trace(mesh.vertices_mm, near, SKIN, "head", hoverinfo="skip"))
    if len(shown.rows):
        figure.add_trace(_solid(table, shown, limits))
    if len(shown.lost):
        at = table.points.points_mm[shown.lost] + 2.0 * table.points.normals[shown.lost]
        figure.add_trace(
            go.Scatter3d(
                x=at[:, 0],
                y=at[:, 1],
                z=at[:, 2],
                mode="markers",
                name="fewer than two views",
                marker={"size": 3.5, "color": "#c81e1e"},
                hovertemplate="fewer than two views<extra></extra>",
            )
        )
    figure.update_layout(**scene_layout(1.5, axes=False, aim_z=0.08), showlegend=False)
    # Fixed ranges: figures that fit themselves to their longest ellipsoid cannot be compared.
    ranges = {f"{axis}axis_range": [low[k], high[k]] for k, axis in enumerate("xyz")}
    figure.update_scenes(**ranges)
    return figure


def _surroundings(table: PointTable) -> tuple[Floats, Floats]:
    """Corners (3,) of a box about the region with room for the longest ellipsoid."""
    points = table.points.points_mm
    margin = max(0.22 * float(np.ptp(points, axis=0).max()), LARGEST_SHARE * table.points.radius_mm)
    return points.min(axis=0) - margin, points.max(axis=0) + margin


def _near_region(mesh: ViewMesh, low: Floats, high: Floats) -> Ints:
    """Faces (F, 3) about the region: shoulders and the back of a head only make it small."""
    if len(mesh.faces) == 0:
        return mesh.faces
    within = (mesh.vertices_mm >= low) & (mesh.vertices_mm <= high)
    inside = np.all(within, axis=1)
    return np.asarray(mesh.faces[np.all(inside[mesh.faces], axis=1)])


def _solid(table: PointTable, shown: Ellipsoids, limits: tuple[float, float]) -> go.Mesh3d:
    import plotly.graph_objects as go
    from trimesh.creation import icosphere

    ball = icosphere(subdivisions=1)
    corners, sides = np.asarray(ball.vertices), np.asarray(ball.faces)
    centres = table.points.points_mm[shown.rows]
    vertices = (np.einsum("kij,vj->kvi", shown.axes, corners) + centres[:, None]).reshape(-1, 3)
    faces = (sides[None] + len(corners) * np.arange(len(shown.rows))[:, None, None]).reshape(-1, 3)
    sigma = table.sigma_mm[shown.rows]
    words = [
        f"σ {s:.3f} mm, {v} views" for s, v in zip(sigma, table.views[shown.rows], strict=True)
    ]
    x, y, z = placed(vertices).T
    i, j, k = faces.T.astype(np.uint16 if len(vertices) < 65_536 else np.uint32)
    return go.Mesh3d(
        x=x,
        y=y,
        z=z,
        i=i,
        j=j,
        k=k,
        intensity=np.repeat(valued(sigma), len(corners)),
        colorscale=GOOD_TO_BAD,
        cmin=limits[0],
        cmax=limits[1],
        showscale=False,
        text=np.repeat(words, len(corners)).tolist(),
        hovertemplate="%{text}<extra></extra>",
        lighting={"ambient": 0.6, "diffuse": 0.6, "specular": 0.1},
        name="ellipsoids",
    )
