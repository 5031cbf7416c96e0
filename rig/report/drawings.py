"""Drawings as inline SVG: image footprints, and the array from the front and from above.

SVG is a fraction of a figure's size, prints sharply and takes its colours from the page.
"""

from __future__ import annotations

import numpy as np

from common.page.html import esc
from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.subject import Subject
from rig.design.layout import Layout
from rig.solids.bodies import place_body
from rig.solids.sight import outline, seen_by

BEYOND = 0.12
"""How much of the surroundings of an image is drawn, as a share of its width."""

DOTS = 160


def _dot(css: str, x: float, y: float, radius: float) -> str:
    return f'<circle class="{css}" cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}"/>'


def _text(css: str, x: float, y: float, size: float, words: str) -> str:
    place = f'x="{x:.1f}" y="{y:.1f}" font-size="{size:.1f}"'
    return f'<text class="{css}" {place}>{esc(words)}</text>'


def _drawn(css: str, box: tuple[float, float, float, float], parts: list[str], label: str) -> str:
    """A figure with an SVG of the given view box (left, top, width, height)."""
    view = " ".join(f"{v:.1f}" for v in box)
    svg = f'<svg class="drawn" viewBox="{view}" role="img" aria-label="{esc(label)}">'
    return f'<figure class="{css}">{svg}{"".join(parts)}</svg>'


def footprint(
    camera: RigCamera, start: RigCamera | None, subject: Subject, ray_max_deg: float
) -> str:
    """What one camera has in its image: the seen points and their outline, before and after."""
    width, height = camera.camera.image_size_px
    after = _seen_pixels(camera, subject, ray_max_deg)
    parts = [f'<rect class="frame" x="-0.5" y="-0.5" width="{width}" height="{height}"/>']
    step = max(1, len(after) // DOTS)
    parts += [_dot("dot", round(x), round(y), width / 220.0) for x, y in after[::step]]
    parts.append(_outlined("after", after))
    if start is not None:
        parts.append(_outlined("before", _seen_pixels(start, subject, ray_max_deg)))
    (cx, cy), arm = camera.camera.principal_point_px, width / 40.0
    across, down = (
        f"M{cx - arm:.0f} {cy:.0f}h{2 * arm:.0f}",
        f"M{cx:.0f} {cy - arm:.0f}v{2 * arm:.0f}",
    )
    parts.append(f'<path class="cross" d="{across}{down}"/>')
    pad, share = BEYOND * width, f"{len(after) / len(subject.check_points):.0%} of the region"
    box = (-pad, -pad, width + 2.0 * pad, height + 2.0 * pad)
    figure = _drawn("footprint", box, parts, f"{camera.name} sees {share}")
    return f"{figure}<figcaption><b>{esc(camera.name)}</b> {share}</figcaption></figure>"


def _seen_pixels(camera: RigCamera, subject: Subject, ray_max_deg: float) -> Floats:
    """Image points (N, 2) of what the camera sees; out of frame too, to show what is cut off."""
    seen = seen_by(camera, subject.check_points, subject.occluder, ray_max_deg, in_frame=False)
    pixels, _ = camera.camera.project(camera.pose, subject.check_points.points_mm[seen])
    return pixels


def _polygon(css: str, corners: Floats) -> str:
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)
    return f'<polygon class="{css}" points="{points}"/>'


def _outlined(css: str, points: Floats) -> str:
    return _polygon(css, outline(points)) if len(points) >= 3 else ""


def array_drawing(
    cameras: tuple[RigCamera, ...],
    layout: Layout,
    subject: Subject,
    axes: tuple[int, int],
    title: str,
) -> str:
    """The bodies and the subject's region projected along one axis of the rig frame.

    ``axes`` are the rig axes to the right and upwards: (0, 2) from the front, where the viewer
    stands behind the cameras; (0, 1) from above.
    """

    def flat(points: Floats) -> Floats:
        """Points (N, 3) on the sheet (N, 2), y down as SVG has it."""
        return points[:, axes] * [1.0, -1.0]

    shapes = [[outline(flat(part)) for part in place_body(c).parts] for c in cameras]
    region = outline(flat(subject.check_points.points_mm))
    everything = np.concatenate([*(corners for shape in shapes for corners in shape), region])
    low, high = everything.min(axis=0), everything.max(axis=0)
    size = float((high - low).max())
    text, pad = size / 30.0, 0.08 * size
    parts = [_polygon("region", region)]
    for camera, shape in zip(cameras, shapes, strict=True):
        css = "solid fixed" if camera.fixed else "solid"
        parts += [_polygon(css, corners) for corners in shape]
    parts += _labels([camera.name for camera in cameras], shapes, text)
    datum = flat(layout.datum_rig_mm[None])[0]
    parts.append(_dot("datum", datum[0], datum[1], text / 4.0))
    parts.append(_ruler(size, low[0], high[1] + 4.5 * text, text))
    width, height = high - low + 2.0 * pad
    box = (low[0] - pad, low[1] - pad, width, height + 4.0 * text)
    return f"{_drawn('drawing', box, parts, title)}<figcaption>{esc(title)}</figcaption></figure>"


def _labels(names: list[str], shapes: list[list[Floats]], text: float) -> list[str]:
    """Names below their bodies, moved down where one would cover an earlier one."""
    places: list[tuple[float, float]] = []
    for k, corners in enumerate(map(np.concatenate, shapes)):
        x, y = corners[:, 0].mean(), corners[:, 1].max() + 1.1 * text
        while any(
            abs(x - other[0]) < 0.3 * text * (len(names[k]) + len(names[i]))
            and abs(y - other[1]) < text
            for i, other in enumerate(places)
        ):
            y += 0.5 * text
        places.append((x, y))
    return [_text("name", x, y, text, name) for name, (x, y) in zip(names, places, strict=True)]


def _ruler(size_mm: float, left: float, down: float, text: float) -> str:
    """A scale bar of a round length."""
    power = 10.0 ** np.floor(np.log10(size_mm / 3.0))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= size_mm / 3.0)
    words = f"{length:g} mm" if length < 2000.0 else f"{length / 1000.0:g} m"
    bar = f'<path class="ruler" d="M{left:.1f} {down:.1f}h{length:.1f}"/>'
    return bar + _text("ruler", left + length + text / 2.0, down + text * 0.35, text, words)
