"""Dots with rings round them: found among all dark parts of a picture, and their codes read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.detection import opencv
from calibration.detection.opencv import Bytes
from calibration.targets.kinds import RING_INNER, RING_OUTER
from geometry.arrays import Bools, Floats, Ints

_SAMPLES_PER_BIT = 8
_LARGEST_FLAW = 0.12
_CELL_PX = 32.0
_SPOKES = 16
LARGEST_DOUBT = 0.3
"""Share of a sector's samples that may say otherwise; the fit of the whole target decides then."""


@dataclass(frozen=True, eq=False)
class Dots:
    """Dark dots: ``centres_px`` (n, 2), ``axes_px`` (n, 2, 2) the half axes as columns.

    ``flaw`` (n,): by how much a part fills its ellipse too little or too much.
    """

    centres_px: Floats
    axes_px: Floats
    flaw: Floats

    def only(self, rows: Bools | Ints) -> Dots:
        """Some of them."""
        return Dots(self.centres_px[rows], self.axes_px[rows], self.flaw[rows])

    def __len__(self) -> int:
        return len(self.centres_px)


@dataclass(frozen=True)
class Reading:
    """A code word as read, from the sector that begins at ``phase`` (0 to 1 of a sector)."""

    word: int
    phase: float
    doubt: float
    """1 less the smallest share of agreeing samples in any sector."""


def find_dots(grey: Bytes, smallest_radius_px: float) -> Dots:
    """Dark elliptic parts that have a brighter surrounding, at two sizes of surrounding."""
    size = max(grey.shape)
    found = [_dots(grey, window, smallest_radius_px) for window in (41, max(101, size // 24))]
    return _distinct(
        Dots(
            np.concatenate([d.centres_px for d in found]),
            np.concatenate([d.axes_px for d in found]),
            np.concatenate([d.flaw for d in found]),
        )
    )


def _dots(grey: Bytes, window: int, smallest_radius_px: float) -> Dots:
    labels, statistics, centroids = opencv.components(grey, window, 8.0, dark=True)
    width, height, area = statistics[:, 2], statistics[:, 3], statistics[:, 4]
    fill = area / np.maximum(width * height, 1)
    # An ellipse fills pi/4 of an upright box round it, less of a slanted one.
    likely = (area >= 2.5 * smallest_radius_px**2) & (fill > 0.25) & (fill < 0.95)
    likely &= (np.maximum(width, height) < 0.2 * max(grey.shape)) & (area < 0.02 * grey.size)
    likely &= np.maximum(width, height) <= 8 * np.minimum(width, height)
    likely[0] = False
    parts = np.flatnonzero(likely)
    shapes = [_ellipse(labels, int(part), statistics[part]) for part in parts]
    axes = np.reshape([shape[0] for shape in shapes], (-1, 2, 2))
    dots = Dots(centroids[parts], axes, np.array([shape[1] for shape in shapes], dtype=np.float64))
    return dots.only(dots.flaw < _LARGEST_FLAW)


def _ellipse(labels: Ints, part: int, box: Ints) -> tuple[Floats, float]:
    """Half axes (2, 2) of the ellipse with a part's second moments, and the part's flaw."""
    left, top, width, height, area = (int(v) for v in box)
    ys, xs = np.nonzero(labels[top : top + height, left : left + width] == part)
    moments = np.cov(np.stack([xs, ys])) + np.eye(2) / 12.0
    values, vectors = np.linalg.eigh(moments)
    half = 2.0 * np.sqrt(np.maximum(values, 1e-6))
    flaw = abs(area / (np.pi * half[0] * half[1]) - 1.0)
    return vectors * half, 9.0 if half[0] < 0.9 or half[1] > 8.0 * half[0] else float(flaw)


def _distinct(dots: Dots) -> Dots:
    """Of dots within one another's radius the one most like an ellipse."""
    kept: list[int] = []
    cells: dict[tuple[int, int], list[int]] = {}
    radius = np.linalg.norm(dots.axes_px, axis=1).max(axis=1) if len(dots) else np.zeros(0)
    for k in np.argsort(dots.flaw, kind="stable"):
        x, y = (int(v // _CELL_PX) for v in dots.centres_px[k])
        near = [
            i for dx in (-1, 0, 1) for dy in (-1, 0, 1) for i in cells.get((x + dx, y + dy), ())
        ]
        away = np.linalg.norm(dots.centres_px[near] - dots.centres_px[k], axis=1)
        if (away < np.minimum(radius[k], _CELL_PX)).any():
            continue
        kept.append(int(k))
        cells.setdefault((x, y), []).append(int(k))
    return dots.only(np.array(sorted(kept), dtype=np.int64))


def proper_axes(axes_px: Floats) -> Floats:
    """The same axes (n, 2, 2) as a map that does not mirror."""
    turned = axes_px.copy()
    turned[np.linalg.det(axes_px) < 0.0, :, 1] *= -1.0
    return np.asarray(turned)


def _sharpened(grey: Bytes, dots: Dots) -> Dots:
    """Dots with ellipses through half the step from black to white.

    A threshold that follows the surroundings cuts all edges too far out, and so makes a slanted
    dot rounder than it is; two and a half radii out that is a different ring.
    """
    edge, found = _edges(grey, dots)
    middle = edge.mean(axis=2)
    x, y = edge[:, 0] - middle[:, :1], edge[:, 1] - middle[:, 1:]
    design = np.stack([x * x, 2.0 * x * y, y * y], axis=-1)
    normal = design.transpose(0, 2, 1) @ design + 1e-9 * np.eye(3)
    form = np.linalg.solve(normal, design.sum(axis=1)[..., None])[..., 0]
    values, vectors = np.linalg.eigh(form[:, [0, 1, 1, 2]].reshape(-1, 2, 2))
    axes = proper_axes(vectors / np.sqrt(np.maximum(values, 1e-6))[:, None, :])
    good = np.asarray(found & np.all(values > 1e-6, axis=1))
    return Dots(dots.centres_px + middle, axes, dots.flaw).only(good)


def _edges(grey: Bytes, dots: Dots) -> tuple[Floats, Bools]:
    """Where each dot's edge is along its spokes, (n, 2, spokes) from its middle; found at all."""
    angle = 2.0 * np.pi * (np.arange(_SPOKES) + 0.5) / _SPOKES
    spokes = np.stack([np.cos(angle), np.sin(angle)])
    reach = np.linspace(0.5, 1.5, 21)
    levels = np.stack([_ring(grey, dots, r, _SPOKES) for r in reach], axis=-1)
    middle = (_middle(grey, dots) + np.median(levels[:, :, -1], axis=1)) / 2.0
    above = levels > middle[:, None, None]
    first = np.clip(np.argmax(above, axis=2), 1, None)[..., None]
    low, high = (np.take_along_axis(levels, first - k, axis=2)[..., 0] for k in (1, 0))
    part = np.clip((middle[:, None] - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    radius = reach[first[..., 0] - 1] + part * (reach[1] - reach[0])
    found = np.asarray(np.all(above.any(axis=2), axis=1))
    return (dots.axes_px @ spokes) * radius[:, None, :], found


def _middle(grey: Bytes, dots: Dots) -> Floats:
    """Grey levels (n,) in the middle of each dot."""
    return opencv.sampled(grey, dots.centres_px[:, None, :])[:, 0]


def ringed(grey: Bytes, dots: Dots) -> Dots:
    """Dots with white round them, then something black in a ring, then white again."""
    if len(dots) == 0:
        return dots
    dots = _sharpened(grey, Dots(dots.centres_px, proper_axes(dots.axes_px), dots.flaw))
    black = _middle(grey, dots)
    inner = _ring(grey, dots, 1.5, 32)
    outer = _ring(grey, dots, 3.5, 48)
    band = _ring(grey, dots, (RING_INNER + RING_OUTER) / 2.0, 112)
    white = np.median(inner, axis=1)
    middle, step = (white + black) / 2.0, white - black
    good = step > 10.0
    good &= (inner > middle[:, None]).mean(axis=1) > 0.93
    good &= (outer > middle[:, None]).mean(axis=1) > 0.85
    dark = (band < middle[:, None]).mean(axis=1)
    good &= (dark > 0.03) & (dark < 0.97)
    return dots.only(good)


def read_codes(grey: Bytes, dots: Dots, bits: int) -> list[Reading]:
    """The word on each dot's ring."""
    band = np.mean([_ring(grey, dots, r, bits * _SAMPLES_PER_BIT) for r in (2.35, 2.5, 2.65)], 0)
    white = np.median(_ring(grey, dots, 1.5, 32), axis=1)
    black = _middle(grey, dots)
    dark = band < ((white + black) / 2.0)[:, None]
    return [_read(row, bits) for row in dark]


def _read(dark: np.ndarray, bits: int) -> Reading:
    """The best of all places where the first sector may begin."""
    n = _SAMPLES_PER_BIT
    best = Reading(0, 0.0, 1.0)
    whole = -1.0
    for shift in range(n):
        share = np.roll(dark, -shift).reshape(bits, n).mean(axis=1)
        agreement = np.maximum(share, 1.0 - share)
        if agreement.mean() > whole:
            whole = float(agreement.mean())
            word = sum(1 << k for k in range(bits) if share[k] > 0.5)
            best = Reading(word, shift / n, 1.0 - float(agreement.min()))
    return best


def sure(reading: Reading) -> bool:
    """Whether each sector's samples agree well enough."""
    return reading.doubt <= LARGEST_DOUBT


def _ring(grey: Bytes, dots: Dots, radius: float, samples: int) -> Floats:
    """Grey levels (n, samples) on an ellipse of so many radii."""
    angle = 2.0 * np.pi * (np.arange(samples) + 0.5) / samples
    circle = radius * np.stack([np.cos(angle), np.sin(angle)])
    place = dots.centres_px[:, :, None] + dots.axes_px @ circle
    return opencv.sampled(grey, place.transpose(0, 2, 1))
