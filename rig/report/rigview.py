"""The rig in three dimensions: head coloured by sigma, bodies, lenses, views, names."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from common.page.html import esc, figure_text
from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.design.layout import Layout
from rig.report.colours import AFTER, BEFORE, BODY, FIXED
from rig.report.scene import frustum_corners_mm
from rig.report.subjectview import subject_traces
from rig.report.surface import ViewMesh
from rig.report.three import BEHIND_EYE, lines_trace, mesh_trace, scene_layout
from rig.solids.bodies import place_body
from solver.result import Design

if TYPE_CHECKING:
    import plotly.graph_objects as go

VIEW_SHARE = 0.42
"""Views are drawn to this share of the way to the subject, so that they do not hide it."""

NAME_SHARE = np.array([0.13, 0.05])
"""Width and height of a name as shares of the cameras' extent in the view."""


def rig_figure(
    design: Design, mesh: ViewMesh, layout: Layout, limits: tuple[float, float]
) -> go.Figure:
    """The main figure."""
    import plotly.graph_objects as go

    figure = go.Figure(subject_traces(mesh, design.quality.points, limits))
    for index, camera in enumerate(design.cameras):
        figure.add_trace(_body_trace(design, layout, index, camera))
    centre = design.quality.points.points.centroid_mm
    figure.add_trace(lines_trace(_view_edges(design.cameras, centre), AFTER, "views"))
    axes = _axes(design.cameras, centre)
    figure.add_trace(
        lines_trace(axes, AFTER, "optical axes", width_px=2.0, dotted=True, visible="legendonly")
    )
    start = _view_edges(design.start_cameras, centre)
    figure.add_trace(lines_trace(start, BEFORE, "start, before optimisation", visible="legendonly"))
    figure.add_trace(_names(design.cameras))
    figure.add_trace(_datum(layout))
    legend = {"orientation": "h", "x": 0.0, "y": 0.0, "yanchor": "top", "bgcolor": "rgba(0,0,0,0)"}
    # Aimed below its middle: the nearest tick's figure is at the lower edge of the scene.
    figure.update_layout(**scene_layout(0.97, aim_z=-0.14))
    figure.update_layout(legend=legend, margin={"l": 0, "r": 0, "t": 0, "b": 60})
    return figure


def _datum(layout: Layout) -> go.Scatter3d:
    import plotly.graph_objects as go

    x, y, z = layout.datum_rig_mm[:, None]
    marker = {"size": 5, "symbol": "diamond", "color": "#c81e1e"}
    words = "datum<extra></extra>"
    return go.Scatter3d(
        x=x, y=y, z=z, mode="markers", name="datum", marker=marker, hovertemplate=words
    )


def _body_trace(design: Design, layout: Layout, index: int, camera: RigCamera) -> go.Mesh3d:
    from scipy.spatial import ConvexHull

    vertices, faces, first = [], [], 0
    for part in place_body(camera).parts:
        hull = ConvexHull(part)
        vertices.append(part)
        faces.append(hull.simplices + first)
        first += len(part)
    pan, tilt, roll = layout.placements[index].pan_tilt_roll_deg
    figures = design.quality.cameras
    lines = [
        f"<b>{esc(camera.name)}</b>{' (fixed)' if camera.fixed else ''}",
        f"pan {figure_text(pan)}°, tilt {figure_text(tilt)}°, roll {figure_text(roll)}°",
        f"{figure_text(float(figures.distance_mm[index]))} mm from the subject's centroid",
        f"focus {figure_text(camera.focus_distance_mm)} mm",
        f"{int(figures.points_seen[index])} points seen",
    ]
    return mesh_trace(
        np.concatenate(vertices),
        np.concatenate(faces),
        FIXED if camera.fixed else BODY,
        esc(camera.name),
        flatshading=True,
        hovertemplate="<br>".join(lines) + "<extra></extra>",
        lighting={"ambient": 0.75, "diffuse": 0.5, "specular": 0.15},
    )


def _view_edges(cameras: tuple[RigCamera, ...], centre: Floats) -> Floats:
    """Edges (8 n, 2, 3) of the views, part of the way to the subject."""
    edges = []
    for camera in cameras:
        away = float(np.linalg.norm(centre - camera.pose.position_rig_mm))
        corners = frustum_corners_mm(camera, away * VIEW_SHARE)
        edges += [(camera.pose.position_rig_mm, corner) for corner in corners]
        edges += [(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    return np.array(edges)


def _axes(cameras: tuple[RigCamera, ...], centre: Floats) -> Floats:
    ends = []
    for camera in cameras:
        eye, axis = camera.pose.position_rig_mm, camera.pose.axis_rig
        ends.append((eye, eye + axis * float(axis @ (centre - eye))))
    return np.array(ends)


def _names(cameras: tuple[RigCamera, ...]) -> go.Scatter3d:
    import plotly.graph_objects as go

    at, places = name_places(cameras)
    return go.Scatter3d(
        x=at[:, 0],
        y=at[:, 1],
        z=at[:, 2],
        mode="text",
        textposition=places,
        text=[esc(c.name) for c in cameras],
        name="names",
        hoverinfo="skip",
        textfont={"size": 20},
    )


def name_places(cameras: tuple[RigCamera, ...]) -> tuple[Floats, list[str]]:
    """Where each camera's name stands (N, 3), and on which side of that place.

    Above its body however it is rolled; below, where another body or name is over it in the view
    that is seen first.
    """
    middles = np.array([c.pose.to_rig(c.camera.body.centre_camera_mm[None])[0] for c in cameras])
    halves = np.array([0.5 * float(np.linalg.norm(c.camera.body.size_mm)) for c in cameras])
    right = np.cross(-np.array(BEHIND_EYE), [0.0, 0.0, 1.0])
    up = np.cross(right, -np.array(BEHIND_EYE))
    flat = middles @ np.stack([right / np.linalg.norm(right), up / np.linalg.norm(up)]).T
    size = NAME_SHARE * max(float(np.ptp(flat, axis=0).max()), float(halves.max()))
    signs: list[float] = []
    taken = np.zeros((0, 2))

    def covered(at: Floats, own: int) -> int:
        """How many other bodies and earlier names are where a name would be."""
        away = np.abs(flat - at) - halves[:, None] - size / 2.0
        bodies = (away < 0.0).all(axis=1) & (np.arange(len(cameras)) != own)
        return int(bodies.sum() + (np.abs(taken - at) < size).all(axis=1).sum())

    for k, half in enumerate(halves):
        options = {s: flat[k] + [0.0, s * (half + size[1] / 2.0)] for s in (1.0, -1.0)}
        sign = min(options, key=lambda s: covered(options[s], k))
        signs.append(sign)
        taken = np.vstack([taken, options[sign]])
    at = middles + (np.array(signs) * halves)[:, None] * [0.0, 0.0, 1.0]
    return at, ["top center" if sign > 0.0 else "bottom center" for sign in signs]
