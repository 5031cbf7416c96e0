"""Drawings of a study's page: curves over the number of cameras, the front, and layouts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from common.page.html import esc
from rig.study.resultfile import Row

WIDTH, HEIGHT, LEFT, RIGHT, FOOT, HEAD = 600.0, 320.0, 72.0, 156.0, 44.0, 14.0
_COLOURS = ("#2f6fdb", "#d9731a", "#1c7c4c", "#8d4bbb", "#b3261e", "#0d8a9e", "#8a5a00", "#5b6675")
Point = tuple[float, float]


def colour(number: int) -> str:
    """One of eight colours that are told apart in light and dark."""
    return _COLOURS[number % len(_COLOURS)]


def curves(series: Mapping[str, Sequence[Point]], x_name: str, y_name: str, label: str) -> str:
    """Lines through points (x, y) for each name, on linear axes; y begins at 0."""
    points = [p for line in series.values() for p in line]
    if not points:
        return ""
    place, parts = _axes(points, x_name, y_name, whole_x=True)
    for number, line in enumerate(series.values()):
        spots = [place(*p) for p in line]
        path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in spots)
        parts.append(f'<path d="{path}" fill="none" stroke="{colour(number)}" stroke-width="2"/>')
        parts += [_circle(x, y, 3.5, colour(number), "") for x, y in spots]
    parts += _legend(list(series))
    return _svg(WIDTH, HEIGHT, parts, label)


def scatter(
    points: Sequence[tuple[float, float, str, bool, str]], x_name: str, y_name: str, label: str
) -> str:
    """Points (x, y, group, whether on the front, words); those beside the front are faint."""
    if not points:
        return ""
    place, parts = _axes([(x, y) for x, y, *_ in points], x_name, y_name, whole_x=False)
    groups = list(dict.fromkeys(group for _, _, group, _, _ in points))
    for x, y, group, front, words in sorted(points, key=lambda p: p[3]):
        at = place(x, y)
        faint = "" if front else ' opacity="0.28"'
        parts.append(_circle(*at, 6.0 if front else 4.0, colour(groups.index(group)), words, faint))
    return _svg(WIDTH, HEIGHT, [*parts, *_legend(groups)], label)


def front_view(row: Row, reach_mm: float, label: str) -> str:
    """The cameras of a rig seen from behind the array towards the face: X across, Z up.

    The hull is drawn about the outermost; the nearer to the face, the darker. ``reach_mm``: half
    the width of the drawing.
    """
    side, half = 240.0, 120.0
    scale = half / reach_mm
    away = np.array([p.position_mm for p in row.places]) - np.array(row.centre_mm)
    spots = np.stack([half + scale * away[:, 0], half - scale * away[:, 2]], axis=1)
    parts = [
        f'<ellipse cx="{half:.0f}" cy="{half:.0f}" rx="{75.0 * scale:.1f}" '
        f'ry="{105.0 * scale:.1f}" class="head"/>'
    ]
    hull = _hull(spots)
    if hull:
        path = "M" + "L".join(f"{spots[k, 0]:.1f} {spots[k, 1]:.1f}" for k in hull) + "Z"
        parts.append(f'<path d="{path}" class="hull"/>')
    depth = -away[:, 1]
    low, span = float(depth.min()), max(float(np.ptp(depth)), 1.0)
    for (x, y), d, place in zip(spots, depth, row.places, strict=True):
        dark = 1.0 - 0.65 * (float(d) - low) / span
        words = f"{place.name}: {d:.0f} mm before the face's centre"
        parts.append(_circle(x, y, 7.0, colour(0), words, f' fill-opacity="{dark:.2f}"'))
    return _svg(side, side, parts, label)


def _hull(spots: np.ndarray) -> list[int]:
    if len(spots) < 3:
        return list(range(len(spots)))
    try:
        return [int(k) for k in ConvexHull(spots).vertices]
    except QhullError:  # all on one line
        order = np.lexsort((spots[:, 1], spots[:, 0]))
        return [int(order[0]), int(order[-1])]


def _axes(
    points: Sequence[Point], x_name: str, y_name: str, *, whole_x: bool
) -> tuple[Callable[[float, float], Point], list[str]]:
    """How points are placed, and the grid that is drawn below them."""
    xs = [x for x, _ in points]
    low, high = min(xs), max(xs)
    pad = 0.5 if whole_x else max(0.06 * (high - low), 1e-9 + 0.02 * abs(high))
    low, high = low - pad, high + pad
    top = max(max(y for _, y in points) * 1.08, 1e-9)

    def place(x: float, y: float) -> Point:
        across = LEFT + (x - low) / (high - low) * (WIDTH - LEFT - RIGHT)
        return across, HEIGHT - FOOT - y / top * (HEIGHT - FOOT - HEAD)

    parts = []
    for y in _ticks(0.0, top):
        (x1, at), (x2, _) = place(low, y), place(high, y)
        parts.append(f'<line x1="{x1:.1f}" y1="{at:.1f}" x2="{x2:.1f}" y2="{at:.1f}" class="g"/>')
        parts.append(_text(x1 - 6.0, at + 4.0, f"{y:g}", "end"))
    steps = range(math.ceil(low), math.floor(high) + 1) if whole_x else _ticks(low, high)
    for x in steps:
        across, foot = place(x, 0.0)
        parts.append(_text(across, foot + 16.0, f"{x:g}", "middle"))
    middle = (LEFT + WIDTH - RIGHT) / 2.0
    parts.append(_text(middle, HEIGHT - 6.0, x_name, "middle"))
    parts.append(
        f'<text transform="translate(12 {(HEIGHT - FOOT) / 2.0:.0f}) rotate(-90)" '
        f'text-anchor="middle">{esc(y_name)}</text>'
    )
    return place, parts


def _ticks(low: float, high: float) -> list[float]:
    """About five round numbers between two."""
    raw = (high - low) / 5.0
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= raw)
    first = math.ceil(low / step)
    return [round(k * step, 10) for k in range(first, math.floor(high / step) + 1)]


def _legend(names: Sequence[str]) -> list[str]:
    parts = []
    for number, name in enumerate(names[: len(_COLOURS)]):
        y = HEAD + 8.0 + 18.0 * number
        parts.append(_circle(WIDTH - RIGHT + 14.0, y - 4.0, 4.0, colour(number), ""))
        parts.append(_text(WIDTH - RIGHT + 23.0, y, name, "start"))
    return parts


def _circle(x: float, y: float, radius: float, fill: str, words: str, more: str = "") -> str:
    title = f"<title>{esc(words)}</title>" if words else ""
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}" fill="{fill}"{more}>{title}</circle>'


def _text(x: float, y: float, words: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{esc(words)}</text>'


def _svg(width: float, height: float, parts: Sequence[str], label: str) -> str:
    return (
        f'<svg class="study" viewBox="0 0 {width:.0f} {height:.0f}" role="img" '
        f'aria-label="{esc(label)}">{"".join(parts)}</svg>'
    )
