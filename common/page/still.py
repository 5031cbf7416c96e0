"""Still pictures of plotly's three-dimensional figures, for browsers without WebGL.

Drawn from the figure itself: meshes, lines, markers and names, the farthest first, seen from
where the figure is first seen, but from infinitely far away.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import plotly.graph_objects as go
    from PIL.ImageDraw import ImageDraw

Floats = NDArray[np.float64]
Rgb = tuple[int, int, int]

SIZE_PX = np.array([960, 600])
_TWICE = 2
"""Drawn twice as large and made smaller, which smooths the edges."""

_MARGIN = 0.05
_QUALITY = 60
_LAMP = np.array([-0.33, -0.8, 0.5])
_INK: Rgb = (120, 128, 140)
"""For names: to be read on light and on dark pages."""


def still_picture(figure: go.Figure) -> str:
    """A ``data:`` address of a WebP picture of what ``figure`` shows at first."""
    from PIL import Image, ImageDraw

    shown = [trace for trace in figure.data if trace.visible in (None, True)]
    sheet = _Sheet.of(figure, shown)
    width, height = (int(v) for v in SIZE_PX * _TWICE)
    image = Image.new("RGBA", (width, height), (0, 0, 0, 0))
    pen = ImageDraw.Draw(image)
    _solids(pen, sheet, [t for t in shown if t.type == "mesh3d"])
    for trace in shown:
        if trace.type == "scatter3d":
            _lines_and_words(pen, sheet, trace)
    buffer = BytesIO()
    smooth = image.resize((width // _TWICE, height // _TWICE), Image.Resampling.LANCZOS)
    smooth.save(buffer, "WEBP", quality=_QUALITY)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode()


@dataclass(frozen=True)
class _Sheet:
    """Where places of the figure come to lie: right, up and towards the viewer, (3, 3) rows."""

    axes: Floats
    middle: Floats
    scale: float

    @classmethod
    def of(cls, figure: go.Figure, shown: list[Any]) -> _Sheet:
        """The sheet that holds everything, seen as the figure's camera sees it."""
        eye = figure.layout.scene.camera.eye
        towards = np.array([eye.x, eye.y, eye.z], dtype=np.float64)
        towards /= np.linalg.norm(towards)
        right = np.cross([0.0, 0.0, 1.0], towards)
        right /= np.linalg.norm(right)
        axes = np.stack([right, np.cross(towards, right), towards])
        places = np.concatenate([_places(trace) for trace in shown])
        seen = places[np.isfinite(places).all(axis=1)] @ axes[:2].T
        low, high = seen.min(axis=0), seen.max(axis=0)
        room = SIZE_PX * _TWICE * (1.0 - 2.0 * _MARGIN)
        return cls(axes, (low + high) / 2.0, float((room / np.maximum(high - low, 1e-9)).min()))

    def at(self, places: Floats) -> Floats:
        """Pixels (N, 2) of places (N, 3)."""
        flat = (places @ self.axes[:2].T - self.middle) * self.scale
        return np.asarray(SIZE_PX * _TWICE / 2.0 + flat * [1.0, -1.0])


def _places(trace: Any) -> Floats:  # noqa: ANN401 - a trace of plotly's
    return np.stack([np.asarray(getattr(trace, k), dtype=np.float64) for k in "xyz"], axis=1)


def _solids(pen: ImageDraw, sheet: _Sheet, traces: list[Any]) -> None:
    """All triangles that face the viewer, the farthest first."""
    corners, colours = [], []
    for trace in traces:
        places = _places(trace)
        sides = np.stack([np.asarray(getattr(trace, k), dtype=np.int64) for k in "ijk"], axis=1)
        corners.append(places[sides])
        colours.append(_colours(trace, sides))
    if not corners:
        return
    every, colour = np.concatenate(corners), np.concatenate(colours)
    normal = np.cross(every[:, 1] - every[:, 0], every[:, 2] - every[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    # Bodies are hulls whose sides are wound either way: everything is lit as it is seen.
    normal *= np.sign(normal @ sheet.axes[2] + 1e-12)[:, None]
    light = 0.55 + 0.5 * np.clip(normal @ _LAMP, 0.0, 1.0)
    fill = np.clip(colour * light[:, None], 0, 255).astype(int)
    pixels = sheet.at(every.reshape(-1, 3)).reshape(-1, 6)
    order = np.argsort(every.mean(axis=1) @ sheet.axes[2], kind="stable")
    for flat, rgb in zip(pixels[order].tolist(), fill[order].tolist(), strict=True):
        pen.polygon(flat, fill=tuple(rgb))


def _colours(trace: Any, sides: NDArray[np.int64]) -> Floats:  # noqa: ANN401 - as above
    """Colours (F, 3) of a mesh's sides."""
    if trace.intensity is None:
        return np.tile(np.array(_rgb(trace.color), dtype=np.float64), (len(sides), 1))
    value = np.asarray(trace.intensity, dtype=np.float64)[sides].mean(axis=1)
    return _scaled(value, trace.cmin, trace.cmax, trace.colorscale)


def _scaled(value: Floats, low: float, high: float, scale: Any) -> Floats:  # noqa: ANN401 - as above
    at, colours = zip(*scale, strict=True)
    table = np.array([_rgb(colour) for colour in colours], dtype=np.float64)
    share = np.clip((value - low) / max(high - low, 1e-12), 0.0, 1.0)
    return np.stack([np.interp(share, at, table[:, k]) for k in range(3)], axis=1)


def _rgb(colour: str) -> Rgb:
    from PIL.ImageColor import getrgb

    red, green, blue = getrgb(colour)[:3]
    return red, green, blue


def _lines_and_words(pen: ImageDraw, sheet: _Sheet, trace: Any) -> None:  # noqa: ANN401 - as above
    from PIL.ImageFont import load_default

    pixels = sheet.at(_places(trace))
    mode = trace.mode or ""
    if "lines" in mode:
        width = round(_TWICE * (trace.line.width or 1.0) / 2.0)
        colour = _rgb(trace.line.color)
        for one, other in pairwise(pixels):
            if np.isfinite(one).all() and np.isfinite(other).all():
                pen.line([*one, *other], fill=colour, width=max(1, width))
    if "markers" in mode:
        size = _TWICE * float(np.max(trace.marker.size)) / 2.0
        colours = trace.marker.color
        one_for_all = isinstance(colours, str)
        marker = trace.marker
        value = np.zeros(len(pixels)) if one_for_all else np.asarray(colours, dtype=np.float64)
        every = (
            np.tile(_rgb(colours), (len(pixels), 1))
            if one_for_all
            else _scaled(value, marker.cmin, marker.cmax, marker.colorscale)
        )
        for (x, y), rgb in zip(pixels, every.astype(int).tolist(), strict=True):
            pen.ellipse([x - size, y - size, x + size, y + size], fill=tuple(rgb))
    if "text" in mode:
        font = load_default(_TWICE * 15)
        for (x, y), words in zip(pixels, trace.text, strict=True):
            pen.text((x, y), str(words), fill=_INK, font=font, anchor="mb")
