"""Drawings as inline SVG: image footprints, and the array from the front and from above.

SVG is a fraction of a figure's size, prints sharply and takes its colours from the page.
"""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.subject import Subject
from rig.bodies import place_body
from rig.layout import Layout
from rig.report.markup import esc
from rig.sight import outline, seen_by

BEYOND = 0.12
"""How much of the surroundings of an image is drawn, as a share of its width."""

DOTS = 220


def footprint(
    camera: RigCamera, start: RigCamera | None, subject: Subject, ray_max_deg: float
) -> str:
    """What one camera has in its image: the seen points and their outline, before and after."""
    width, height = camera.camera.image_size_px
    pad = BEYOND * width
    after = _seen_pixels(camera, subject, ray_max_deg)
    parts = [f'<rect class="frame" x="-0.5" y="-0.5" width="{width}" height="{height}"/>']
    step = max(1, len(after) // DOTS)
    radius = width / 220.0
    parts += [f'<circle class="dot" cx="{x:.0f}" cy="{y:.0f}" r="{radius:.1f}"/>' for x, y in after[::step]]
    parts.append(_polygon("after", after))
    if start is not None:
        parts.append(_polygon("before", _seen_pixels(start, subject, ray_max_deg)))
    cx, cy = camera.camera.principal_point_px
    arm = width / 40.0
    parts.append(
        f'<path class="cross" d="M{cx - arm:.0f} {cy:.0f}H{cx + arm:.0f}M{cx:.0f} {cy - arm:.0f}V{cy + arm:.0f}"/>'
    )
    box = f"{-pad:.0f} {-pad:.0f} {width + 2 * pad:.0f} {height + 2 * pad:.0f}"
    share = len(after) / len(subject.check_points)
    label = f"{esc(camera.name)}: sees {share:.0%} of the region"
    return (
        f'<figure class="footprint"><svg class="drawn" viewBox="{box}" role="img" aria-label="{label}">'
        f"{''.join(parts)}</svg><figcaption><b>{esc(camera.name)}</b> {share:.0%} of the region"
        "</figcaption></figure>"
    )


def _seen_pixels(camera: RigCamera, subject: Subject, ray_max_deg: float) -> Floats:
    """Image points (N, 2) of what the camera sees; out of frame too, to show what is cut off."""
    seen = seen_by(camera, subject.check_points, subject.occluder, ray_max_deg, in_frame=False)
    pixels, _ = camera.camera.project(camera.pose, subject.check_points.points_mm[seen])
    return pixels


def _polygon(css: str, points: Floats) -> str:
    if len(points) < 3:
        return ""
    corners = " ".join(f"{x:.0f},{y:.0f}" for x, y in outline(points))
    return f'<polygon class="{css}" points="{corners}"/>'


def array_drawing(
    cameras: tuple[RigCamera, ...], layout: Layout, subject: Subject, axes: tuple[int, int], title: str
) -> str:
    """The bodies and the subject's region projected along one axis of the rig frame.

    ``axes`` are the rig axes to the right and upwards: (0, 2) from the front, where the viewer
    stands behind the cameras; (0, 1) from above.
    """
    bodies = [place_body(camera) for camera in cameras]
    shapes = [[outline(part[:, axes]) for part in body.parts] for body in bodies]
    region = outline(subject.check_points.points_mm[:, axes])
    everything = np.concatenate([*(corners for shape in shapes for corners in shape), region])
    low, high = everything.min(axis=0), everything.max(axis=0)
    size = (high - low).max()
    pad = 0.08 * size
    text = size / 30.0

    def flip(points: Floats) -> str:
        return " ".join(f"{x - low[0]:.1f},{high[1] - y:.1f}" for x, y in points)

    parts = [f'<polygon class="region" points="{flip(region)}"/>']
    for camera, shape in zip(cameras, shapes, strict=True):
        css = "solid fixed" if camera.fixed else "solid"
        parts += [f'<polygon class="{css}" points="{flip(corners)}"/>' for corners in shape]
    under = [(corners[:, 0].mean() - low[0], high[1] - corners[:, 1].min()) for corners in map(np.concatenate, shapes)]
    names = [camera.name for camera in cameras]
    for name, (x, y) in zip(names, _label_places(names, under, text), strict=True):
        parts.append(f'<text x="{x:.1f}" y="{y:.1f}" font-size="{text:.1f}">{esc(name)}</text>')
    datum = layout.datum_rig_mm[list(axes)]
    parts.append(
        f'<circle class="datum" cx="{datum[0] - low[0]:.1f}" cy="{high[1] - datum[1]:.1f}" r="{text / 4:.1f}"/>'
    )
    parts.append(_ruler(size, (high - low)[1] + 4.5 * text, text))
    width, height = (high - low) + 2 * pad
    box = f"{-pad:.1f} {-pad:.1f} {width:.1f} {height + 4.0 * text:.1f}"
    return (
        f'<figure class="drawing"><svg class="drawn" viewBox="{box}" role="img" aria-label="{esc(title)}">'
        f"{''.join(parts)}</svg><figcaption>{esc(title)}</figcaption></figure>"
    )


def _label_places(
    names: list[str], under: list[tuple[float, float]], text: float
) -> list[tuple[float, float]]:
    """Places below the bodies, moved down where a name would cover an earlier one."""
    places: list[tuple[float, float]] = []
    for k, (x, y) in enumerate(under):
        spot = (x, y + 1.1 * text)
        while any(
            abs(spot[0] - other[0]) < 0.3 * text * (len(names[k]) + len(names[i]))
            and abs(spot[1] - other[1]) < text
            for i, other in enumerate(places)
        ):
            spot = (spot[0], spot[1] + 0.5 * text)
        places.append(spot)
    return places


def _ruler(size_mm: float, at: float, text: float) -> str:
    """A scale bar of a round length."""
    power = 10.0 ** np.floor(np.log10(size_mm / 3.0))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= size_mm / 3.0)
    words = f"{length:g} mm" if length < 2000.0 else f"{length / 1000.0:g} m"
    return (
        f'<path class="ruler" d="M0 {at:.1f}H{length:.1f}"/>'
        f'<text class="ruler" x="{length + text / 2:.1f}" y="{at + text * 0.35:.1f}" font-size="{text:.1f}">{words}</text>'
    )
