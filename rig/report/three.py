"""Pieces of the three-dimensional figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import Floats, Ints

if TYPE_CHECKING:
    import plotly.graph_objects as go

SOFT = {"ambient": 0.55, "diffuse": 0.75, "specular": 0.05, "roughness": 0.9, "fresnel": 0.05}
LAMP = {"x": -4000, "y": -12000, "z": 9000}
"""Above the left shoulder of a viewer behind the cameras."""


BEHIND_EYE = (-0.9, -1.45, 0.45)
"""Where a viewer behind the cameras looks from at first, in units of the scene's box."""

_PLACES = 4096.0
_BITS = 512.0


def placed(places_mm: Floats) -> Floats:
    """Places (N, 3) as a page needs them: to a few thousandths of their extent.

    What is rounded to steps of two packs to half, which is what keeps the page small.
    """
    extent = float(np.ptp(places_mm, axis=0).max()) if len(places_mm) else 1.0
    step = 2.0 ** np.floor(np.log2(max(extent, 1e-6) / _PLACES))
    return np.asarray((np.round(np.asarray(places_mm) / step) * step).astype(np.float32))


def valued(values: Floats) -> Floats:
    """Values to a thousandth of themselves, likewise."""
    mantissa, exponent = np.frexp(values)
    return np.asarray(np.ldexp(np.round(mantissa * _BITS) / _BITS, exponent).astype(np.float32))


def mesh_trace(
    vertices_mm: Floats, faces: Ints, colour: str, name: str, **more: object
) -> go.Mesh3d:
    """A mesh (V, 3), (F, 3) in one colour."""
    import plotly.graph_objects as go

    x, y, z = placed(vertices_mm).T
    i, j, k = np.asarray(faces).T.astype(np.uint16 if len(vertices_mm) < 65_536 else np.uint32)
    options = {"color": colour, "lighting": SOFT, "lightposition": LAMP, "name": name} | more
    return go.Mesh3d(x=x, y=y, z=z, i=i, j=j, k=k, **options)


def lines_trace(
    segments: Floats,
    colour: str,
    name: str,
    *,
    width_px: float = 3.0,
    dotted: bool = False,
    **more: object,
) -> go.Scatter3d:
    """Line segments (S, 2, 3) as one trace."""
    import plotly.graph_objects as go

    gaps = np.full((len(segments), 1, 3), np.nan)
    x, y, z = np.concatenate([segments, gaps], axis=1).reshape(-1, 3).T.astype(np.float32)
    line = {"color": colour, "width": width_px} | ({"dash": "dot"} if dotted else {})
    return go.Scatter3d(x=x, y=y, z=z, mode="lines", line=line, name=name, hoverinfo="skip", **more)


def scene_layout(
    zoom: float, *, axes: bool = True, aim_z: float = -0.08, behind: bool = True
) -> dict[str, Any]:
    """A scene in true proportion, seen from the cameras' side.

    From the subject's side where not ``behind``.

    ``aim_z`` is the height the viewer looks at, in units of the scene's box.
    """
    axis = {
        "showbackground": False,
        "gridcolor": "#c9ced8",
        "zeroline": False,
        "showspikes": False,
        "nticks": 6,
        "visible": axes,
    }
    look = np.array(BEHIND_EYE if behind else (-1.3, 1.1, 0.45)) / zoom
    return {
        "scene": {
            "aspectmode": "data",
            "xaxis": {**axis, "title": {"text": "X (mm)"}},
            "yaxis": {**axis, "title": {"text": "Y (mm)"}},
            "zaxis": {**axis, "title": {"text": "Z (mm)"}},
            "camera": {
                "eye": dict(zip("xyz", look.tolist(), strict=True)),
                "center": {"x": 0, "y": 0, "z": aim_z},
                "up": {"x": 0, "y": 0, "z": 1},
                "projection": {"type": "perspective"},
            },
            "dragmode": "orbit",
        },
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "uirevision": "keep",
    }
