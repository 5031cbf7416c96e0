"""The rig with its structure in three dimensions, ready to be drawn apart."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from common.page.html import esc
from geometry.arrays import Floats
from geometry.raycast import Occluder
from geometry.viewmesh import simplified
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.structure import Solid
from rig.report.colours import BODY, FIXED, LENS, SKIN
from rig.report.three import mesh_trace, scene_layout

if TYPE_CHECKING:
    import plotly.graph_objects as go

KINDS: dict[str, tuple[str, str, int]] = {
    "member": ("#9aa7b8", "profiles and tubes", 0),
    "plate": ("#b9c2cf", "plates", 0),
    "bracket": ("#c98f3c", "brackets", 1),
    "joint": ("#e0a458", "corner brackets and pivots", 0),
    "wedge": ("#2f9e8f", "printed wedges", 1),
    "head": ("#5b4b8a", "heads", 2),
    "camera": (BODY, "cameras", 3),
    "lens": (LENS, "lenses", 4),
    "cable": ("#b3261e", "cables", 3),
}
"""By kind of solid: colour, name, and how many steps it moves when the rig is drawn apart."""

OTHER = (FIXED, "other parts", 1)
STEP_SHARE = 0.035
"""A step as a share of the rig's size."""

APART_SHARE = 0.35
"""By how much members and each camera with what holds it move away from the rig's middle."""

WHOLE_HEIGHT_RATIO = 1.45
"""Height of a scene's box over the cube root of its volume that is seen whole; a higher rig is
looked at from farther off."""

MOST_HEAD_FACES = 9_000


Moves = dict[str, list[list[float]]]
"""``at``: where points stand in the whole rig, ``way``: where they go; x, y and z of each."""


def plan_figure(
    plan: MountPlan, solids: Sequence[Solid], occluder: Occluder | None = None
) -> tuple[go.Figure, dict[str, Moves]]:
    """The figure, and per trace name how its points move when the rig is drawn apart."""
    import plotly.graph_objects as go

    ways: dict[str, Moves] = {}
    figure = go.Figure()
    if occluder is not None and len(occluder.faces):
        vertices, faces = simplified(occluder.vertices_mm, occluder.faces, MOST_HEAD_FACES)
        figure.add_trace(mesh_trace(vertices, faces, SKIN, "subject", hoverinfo="skip"))
    apart = _ways(plan, solids)
    for kind in dict.fromkeys(solid.kind for solid in solids):
        rows = [k for k, solid in enumerate(solids) if solid.kind == kind]
        trace, name, moves = _kind_trace(kind, [solids[k] for k in rows], apart[rows])
        figure.add_trace(trace)
        ways[name] = moves
    # Aimed below its middle: the nearest axis's title is at the lower edge of the scene.
    # A plate hides its cameras from behind; it is worked on from the subject's side.
    zoom = 0.85 * min(1.0, WHOLE_HEIGHT_RATIO / _box_height(solids))
    figure.update_layout(**scene_layout(zoom, aim_z=-0.14, behind=not plan.structure.plates))
    legend = {"orientation": "h", "x": 0.0, "y": 0.0, "yanchor": "top", "bgcolor": "rgba(0,0,0,0)"}
    figure.update_layout(legend=legend, margin={"l": 0, "r": 0, "t": 0, "b": 60})
    return figure, ways


def _box_height(solids: Sequence[Solid]) -> float:
    """Height of the scene's box, which is drawn in proportion and with a volume of one."""
    corners = np.concatenate([s.corners_mm for s in solids])
    spans = np.ptp(corners, axis=0)
    return float(spans[2] / np.cbrt(spans.prod()))


def _kind_trace(kind: str, solids: list[Solid], apart: Floats) -> tuple[go.Mesh3d, str, Moves]:
    """All solids of one kind as one trace: a page with a hundred cameras stays quick."""
    from scipy.spatial import ConvexHull

    colour, name, _ = KINDS.get(kind, OTHER)
    vertices, faces, names, moved, first = [], [], [], [], 0
    for solid, way in zip(solids, apart, strict=True):
        hull = ConvexHull(solid.corners_mm)
        used, simplices = np.unique(hull.simplices, return_inverse=True)
        vertices.append(solid.corners_mm[used])
        faces.append(simplices.reshape(-1, 3) + first)
        names += [esc(solid.owner)] * len(used)
        moved.append(np.tile(way, (len(used), 1)))
        first += len(used)
    trace = mesh_trace(
        np.concatenate(vertices),
        np.concatenate(faces),
        colour,
        name,
        flatshading=True,
        text=names,
        hovertemplate="%{text}<extra></extra>",
        showlegend=True,
        lighting={"ambient": 0.7, "diffuse": 0.55, "specular": 0.1},
    )
    moves = {"at": np.concatenate(vertices), "way": np.concatenate(moved)}
    return trace, name, {key: np.round(value.T, 2).tolist() for key, value in moves.items()}


def _ways(plan: MountPlan, solids: Sequence[Solid]) -> Floats:
    """Where each solid goes when the rig is drawn apart, (S, 3): outwards, and along its camera."""
    corners = np.concatenate([s.corners_mm for s in solids])
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle, size = (low + high) / 2.0, float(np.linalg.norm(high - low))
    poses = {m.name: m.camera.pose for m in plan.mounts}
    camera_of = {name: m.name for m in plan.mounts for name in m.carried_by}
    camera_of |= {w.id: w.camera for w in plan.structure.wedges}
    camera_of |= {p.id: p.camera for p in plan.structure.parts if p.camera}
    ways = []
    for solid in solids:
        steps = KINDS.get(solid.kind, OTHER)[2]
        pose = poses.get(solid.owner) or poses.get(camera_of.get(solid.owner, ""))
        if pose is None or not steps:
            ways.append(APART_SHARE * (solid.corners_mm.mean(axis=0) - middle))
            continue
        along = steps * STEP_SHARE * size * pose.axis_rig
        ways.append(APART_SHARE * (pose.position_rig_mm - middle) + along)
    return np.array(ways)
