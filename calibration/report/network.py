"""What was calibrated: the values of each camera, and where cameras and targets stand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from calibration.adjustment.result import Calibration
from common.page.html import esc, text_table
from common.page.svg import FAINT, GREEN, INK, dot, drawing, line, words
from geometry.arrays import Floats
from geometry.camera import TERM_NAMES

_WIDTH, _MARGIN = 480.0, 40.0
_TALLEST = 320.0
"""Cameras may stand far from the targets: the view from above is drawn smaller, not taller."""

_SIGHT_SHARE = 0.2
"""How long a line of sight is drawn, of the width of what is shown."""

_GREY = "#7b8794"
_EYE = {"x": -0.9, "y": -1.45, "z": 0.6}
VIEWS = (("from above", (0, 1)), ("from the front", (0, 2)))
"""Words, and the axes of the rig that point right and up in the picture."""


def values_table(calibration: Calibration) -> str:
    """Focal length, principal point, distortion and place of each camera."""
    terms = TERM_NAMES[calibration.cameras[0].interior.lens_model]
    head = ("camera", "f px", "cx px", "cy px", *terms, "X mm", "Y mm", "Z mm")
    rows = []
    for camera in calibration.cameras:
        inner = camera.interior
        centre = (f"{v:.2f}" for v in inner.principal_point_px)
        bent = (f"{v:.5f}" for v in inner.distortion)
        place = (f"{v:.2f}" for v in camera.pose.position_rig_mm)
        rows.append((camera.name, f"{inner.focal_length_px:.2f}", *centre, *bent, *place))
    return text_table(head, rows)


def target_places(calibration: Calibration) -> Floats:
    """Every target wherever it was seen to stand, (n, 3) in the rig's frame, mm."""
    spans, first = {}, 0
    for carrier in calibration.targets.carriers:
        spans[carrier.name] = slice(first, first + len(carrier.ids))
        first += len(carrier.ids)
    shown = [
        p.position_rig_mm + calibration.target_mm[spans[p.carrier]] @ p.rotation_carrier_to_rig.T
        for p in calibration.places
    ]
    places = np.concatenate(shown) if shown else np.zeros((0, 3))
    return np.asarray(places[np.isfinite(places).all(axis=1)])


def turning_figure(calibration: Calibration) -> dict[str, Any]:
    """Cameras, their lines of sight and all places of targets for plotly, as plain data."""
    targets = target_places(calibration)
    eyes = np.array([c.pose.position_rig_mm for c in calibration.cameras])
    ways = np.array([c.pose.rotation_rig_to_camera[2] for c in calibration.cameras])
    reach = _SIGHT_SHARE * float(np.ptp(np.concatenate([eyes, targets]), axis=0).max())
    gaps = np.full_like(eyes, np.nan)
    sights = np.stack([eyes, eyes + reach * ways, gaps], axis=1).reshape(-1, 3)
    names = [esc(c.name) for c in calibration.cameras]
    cameras = {"mode": "markers+text", "text": names, "textposition": "top center"}
    axis = {"showbackground": False, "zeroline": False, "nticks": 6}
    scene: dict[str, Any] = {
        f"{name}axis": {**axis, "title": {"text": f"{name.upper()} (mm)"}} for name in "xyz"
    }
    scene |= {"aspectmode": "data", "dragmode": "orbit", "camera": {"eye": _EYE}}
    return {
        "data": [
            _points(targets, name="targets", mode="markers", marker={"size": 1.5, "color": _GREY}),
            _points(sights, name="lines of sight", mode="lines", line={"color": INK, "width": 3}),
            _points(eyes, name="cameras", marker={"size": 5, "color": GREEN}, **cameras),
        ],
        "layout": {
            "scene": scene,
            "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
            "legend": {"orientation": "h"},
        },
    }


def _points(places: Floats, **more: object) -> dict[str, Any]:
    """A trace through places (n, 3); None where a line is interrupted."""
    columns = [[round(v, 2) if np.isfinite(v) else None for v in row] for row in places.T.tolist()]
    return {"type": "scatter3d", **dict(zip("xyz", columns, strict=True)), **more}


def network_figures(calibration: Calibration) -> str:
    """Cameras with their lines of sight and all places of targets, from above and in front."""
    targets = target_places(calibration)
    eyes = np.array([c.pose.position_rig_mm for c in calibration.cameras])
    ways = np.array([c.pose.rotation_rig_to_camera[2] for c in calibration.cameras])
    reach = _SIGHT_SHARE * float(np.ptp(np.concatenate([eyes, targets]), axis=0).max())
    figures = []
    for told, axes in VIEWS:
        at, height = _placing(np.concatenate([eyes, eyes + reach * ways, targets])[:, axes])
        parts = [dot(*at(point), 1.2, FAINT) for point in targets[:, axes]]
        for camera, eye, way in zip(calibration.cameras, eyes, ways, strict=True):
            (x, y), (x_end, y_end) = at(eye[list(axes)]), at((eye + reach * way)[list(axes)])
            parts += [line(x, y, x_end, y_end, INK), dot(x, y, 4.0, GREEN)]
            parts.append(words(x, y + 16.0, 11.0, camera.name, "middle"))
        picture = drawing(_WIDTH, height, parts, f"Cameras and targets {told}")
        style = f"width:{_WIDTH:.0f}px"
        figures.append(f"<figure style='{style}'>{picture}<figcaption>{told}</figcaption></figure>")
    return f'<div class="plots">{"".join(figures)}</div>'


def _placing(points: Floats) -> tuple[Callable[[Floats], tuple[float, float]], float]:
    """Where points (n, 2) of the rig fall in the picture, and how tall it is."""
    low, high = points.min(axis=0), points.max(axis=0)
    room = np.array([_WIDTH, _TALLEST]) - 2.0 * _MARGIN
    scale = float((room / np.maximum(high - low, 1e-9)).min())
    height = float((high - low)[1]) * scale + 2.0 * _MARGIN
    left = (_WIDTH - float((high - low)[0]) * scale) / 2.0

    def at(point: Floats) -> tuple[float, float]:
        x, y = (point - low) * scale
        return left + float(x), height - _MARGIN - float(y)

    return at, height
