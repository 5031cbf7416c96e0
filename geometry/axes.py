"""Which way a scan stands: up and front found from the shape of a head.

A head is symmetric left to right, its nose stands out on the plane of symmetry, its crown is
round while its lower end is cut through the neck or widens to the shoulders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, Ints

DIRECTIONS = {
    sign + name: (1.0 if sign == "+" else -1.0) * np.eye(3)[index]
    for index, name in enumerate("xyz")
    for sign in "+-"
}
"""Unit vector (3,) of each axis direction by name."""

_USUAL = (("+y", "+z"), ("+z", "-y"))
_USUAL_BONUS = 0.05
_CLEAR_LEAD = 0.03
_LEAST_NOSE = 0.08
_FULL_NOSE = 0.3
_MOST_NOSE = 0.6
_SLAB = 0.25
_SAMPLES = 20_000
_ROWS = 40
_REMEDY = 'give up and front, for example up = "+y", front = "+z"'


@dataclass(frozen=True)
class Axes:
    """The directions of the file, such as ``+y``, that point up and out of the face."""

    up: str
    front: str

    def __post_init__(self) -> None:
        known = self.up in DIRECTIONS and self.front in DIRECTIONS
        if not known or DIRECTIONS[self.up] @ DIRECTIONS[self.front] != 0.0:
            problem = f"up {self.up!r} and front {self.front!r} do not make a frame"
            raise InputError("axes", problem, _REMEDY)

    @property
    def rotation_file_to_rig(self) -> Floats:
        """Maps directions of the file to the rig frame, (3, 3)."""
        up, front = DIRECTIONS[self.up], DIRECTIONS[self.front]
        return np.stack([np.cross(up, front), -front, up])


RIG_AXES = Axes("+z", "-y")
"""Axes of a file that stands in the rig frame already."""

GLTF_AXES = Axes("+y", "+z")
"""Axes that glTF prescribes."""


def surface_samples(vertices: Floats, faces: Ints, count: int = _SAMPLES) -> Floats:
    """Points (N, 3) spread evenly by area, or the vertices themselves when there are no faces."""
    rng = np.random.default_rng(0)
    if len(faces) == 0:
        if len(vertices) <= count:
            return vertices
        return vertices[rng.choice(len(vertices), count, replace=False)]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    pick = np.searchsorted(area, (np.arange(count) + 0.5) / count * area[-1])
    u, v = rng.random((2, count, 1))
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    return np.asarray(a[pick] + u * (b - a)[pick] + v * (c - a)[pick])


def infer_axes(samples: Floats, up: str = "auto", front: str = "auto") -> tuple[Axes, bool]:
    """The axes that make ``samples`` (N, 3) look most like a head, and whether usage decided.

    ``up`` and ``front`` narrow the choice when they are not ``auto``. Between equals, +y up with
    +z front and +z up with -y front are taken, the usual ones. Raises :class:`InputError`
    when no choice stands out.
    """
    choices = [
        Axes(u, f)
        for u in DIRECTIONS
        for f in DIRECTIONS
        if up in ("auto", u) and front in ("auto", f) and DIRECTIONS[u] @ DIRECTIONS[f] == 0.0
    ]
    if not choices:
        Axes(up, front)
    if len(choices) == 1:
        return choices[0], False
    local = (samples - (samples.min(axis=0) + samples.max(axis=0)) / 2.0) / np.ptp(
        samples, axis=0
    ).max()
    symmetry = [_asymmetry(local, axis) for axis in range(3)]
    plain = [_likeness(local, axes, symmetry) for axes in choices]
    usual = [_USUAL_BONUS * ((axes.up, axes.front) in _USUAL) for axes in choices]
    scores = np.array([score + bonus for (score, _), bonus in zip(plain, usual, strict=True)])
    order = np.argsort(-scores, kind="stable")
    best = int(order[0])
    if plain[best][1] < _LEAST_NOSE or scores[best] - scores[order[1]] < _CLEAR_LEAD:
        raise InputError("axes-unclear", "it is not clear which way the scan faces", _REMEDY)
    lead = plain[best][0] - max(plain[k][0] for k in order[1:])
    return choices[best], bool(lead < _CLEAR_LEAD)


def _asymmetry(points: Floats, axis: int) -> float:
    """Median distance between the points and their mirror image, in sizes of the scan."""
    from scipy.spatial import cKDTree

    some = points[:: max(1, len(points) // 4000)]
    mirrored = some.copy()
    # The plane lies where the scan is centred by extent; the median bears a lopsided sampling.
    mirrored[:, axis] = -mirrored[:, axis]
    distance, _ = cKDTree(points).query(mirrored)
    return float(np.percentile(distance, 75))


def _likeness(points: Floats, axes: Axes, asymmetry: list[float]) -> tuple[float, float]:
    """How much the points look like a head that stands as ``axes`` say, and the nose's share."""
    rotation = axes.rotation_file_to_rig
    side = int(np.abs(rotation[0]).argmax())
    turned = points @ rotation.T
    nose = _nose(turned)
    return 2.0 * min(nose, _FULL_NOSE) + 0.5 * _lower_end(turned) - 5.0 * asymmetry[side], nose


def _nose(points: Floats) -> float:
    """How far the middle of the front stands out from what is beside it, in half widths."""
    x, depth, z = points[:, 0], -points[:, 1], points[:, 2]
    row = np.minimum(((z - z.min()) / np.ptp(z) * _ROWS).astype(int), _ROWS - 1)
    found = [_row_nose(x[row == k], depth[row == k]) for k in range(_ROWS)]
    widest = max(half for half, _ in found)
    # At the ends of the scan the rows are narrow and the measure means nothing.
    return max((out for half, out in found if half > 0.3 * widest), default=0.0)


def _row_nose(x: Floats, depth: Floats) -> tuple[float, float]:
    """Half width of a row near its front and how far its middle stands out, in half widths."""
    if len(x) < 30:
        return 0.0, 0.0
    # Sizes are in extents of the scan. The slab ends before shoulders behind a head begin.
    slab = depth > depth.max() - _SLAB
    x, depth = x[slab], depth[slab]
    half = float(np.percentile(np.abs(x), 98))
    middle = depth[np.abs(x) < 0.06 * half]
    beside = [depth[np.abs(x - sign * 0.25 * half) < 0.06 * half] for sign in (-1.0, 1.0)]
    if half == 0.0 or len(middle) == 0 or min(len(part) for part in beside) == 0:
        return half, 0.0
    # The higher side counts, so that an edge that falls away to one side is no nose. What stands
    # out by more than a nose can is a neck or a limb.
    out = float(middle.max() - max(part.max() for part in beside)) / half
    return half, out if out < _MOST_NOSE else 0.0


def _lower_end(points: Floats) -> float:
    """How much wider the lower end is than the upper, in widths of the scan."""
    z = points[:, 2]
    band = 0.03 * np.ptp(z)
    width = float(np.ptp(points[:, 0]))
    lower, upper = points[z < z.min() + band, 0], points[z > z.max() - band, 0]
    return float(np.ptp(lower) - np.ptp(upper)) / width if width > 0.0 else 0.0
