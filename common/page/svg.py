"""Small drawings as inline SVG: no library, no script, sharp in print."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise

import numpy as np

GREEN, YELLOW, RED, INK, FAINT = "#1a7f37", "#b08800", "#b42318", "#1f2933", "#c4ccd4"
_NAME_PX = 12.0
Placing = Callable[[int, float], tuple[float, float]]


def line(x1: float, y1: float, x2: float, y2: float, colour: str, width: float = 1.0) -> str:
    """A straight line."""
    ends = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
    return f'<line {ends} stroke="{colour}" stroke-width="{width:.2f}"/>'


def dot(x: float, y: float, radius: float, colour: str) -> str:
    """A filled circle."""
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" fill="{colour}"/>'


def words(x: float, y: float, size: float, text: str, anchor: str = "start") -> str:
    """A line of text."""
    place = f'x="{x:.1f}" y="{y:.1f}" font-size="{size:.1f}" text-anchor="{anchor}"'
    return f'<text {place} fill="{INK}">{escape(text)}</text>'


def drawing(width: float, height: float, parts: Sequence[str], label: str) -> str:
    """An SVG with its label for those who do not see it."""
    head = f'<svg viewBox="0 0 {width:.0f} {height:.0f}" role="img" aria-label="{escape(label)}">'
    return f"{head}<title>{escape(label)}</title>{''.join(parts)}</svg>"


@dataclass(frozen=True)
class Series:
    """One line of a chart: its name and a value for each time, NaN where there is none."""

    name: str
    values: tuple[float, ...]


def chart(
    times: Sequence[str], series: Sequence[Series], limit: float, label: str, unit: str
) -> str:
    """Values over checks on a logarithmic axis, with a limit as a dashed line."""
    width, height, left, foot = 860.0, 300.0, 64.0, 34.0
    everything = [v for s in series for v in s.values if np.isfinite(v) and v > 0.0]
    everything += [limit] if limit > 0.0 else []
    low, high = min(everything, default=0.1), max(everything, default=1.0)
    low, high = np.log10(low) - 0.1, np.log10(high) + 0.1
    step = (width - left - 120.0) / max(len(times) - 1, 1)

    def place(k: int, value: float) -> tuple[float, float]:
        share = (np.log10(value) - low) / (high - low)
        return left + k * step, float(height - foot - share * (height - foot - 12.0))

    parts = []
    for power in range(int(np.ceil(low)), int(np.floor(high)) + 1):
        _, y = place(0, 10.0**power)
        parts.append(line(left, y, width - 120.0, y, FAINT))
        parts.append(words(left - 6.0, y + 4.0, 11, f"{10.0**power:g}", "end"))
    if limit > 0.0:
        _, y = place(0, limit)
        dashed = line(left, y, width - 120.0, y, RED).replace("/>", ' stroke-dasharray="6 4"/>')
        parts += [dashed, words(width - 116.0, y - 4.0, 11, "alarm")]
    for n, one in enumerate(series):
        parts += _curve(one, n, len(series), place)
    parts += _names(series, place)
    ends = sorted({0, len(times) - 1}) if times else []
    for k in ends:
        anchor = "start" if k == 0 else "end"
        parts.append(words(left + k * step, height - 10.0, 11, times[k][:16], anchor))
    return drawing(width, height, [*parts, words(4.0, 12.0, 11, unit)], label)


def _curve(one: Series, number: int, count: int, place: Placing) -> list[str]:
    colour = f"hsl({round(330.0 * number / max(count, 1))} 60% 42%)"
    points = [(k, v) for k, v in enumerate(one.values) if np.isfinite(v) and v > 0.0]
    spots = [place(k, v) for k, v in points]
    parts = [line(*a, *b, colour, 1.6) for a, b in pairwise(spots)]
    parts += [dot(x, y, 3.0, colour) for x, y in spots]
    return parts


def _names(series: Sequence[Series], place: Placing) -> list[str]:
    """Each line's name at its last point, moved down where another name is in its way."""
    ends = [
        (*place(*points[-1]), one.name)
        for one in series
        if (points := [(k, v) for k, v in enumerate(one.values) if np.isfinite(v) and v > 0.0])
    ]
    parts, lowest = [], dict[float, float]()
    for x, y, name in sorted(ends):
        lowest[x] = max(y, lowest.get(x, -np.inf) + _NAME_PX)
        parts.append(words(x + 7.0, lowest[x] + 4.0, 11, name))
    return parts
