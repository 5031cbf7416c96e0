"""The collinearity equations with Brown-Conrady distortion, and their closed-form partials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import INTERIOR, PER_CAMERA
from calibration.adjustment.state import State
from geometry.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Sight:
    """Which camera saw which target of which placed carrier; all (n,)."""

    camera: Ints
    pose: Ints
    target: Ints


@dataclass(frozen=True, eq=False)
class Partials:
    """Computed pixels (n, 2), depths (n,) and partials of the pixels.

    ``camera`` (n, 2, 15) by interior and exterior orientation, ``pose`` (n, 2, 6) by shift and
    turn of the carrier in the rig frame, ``target`` (n, 2, 3) in the carrier's frame.
    """

    pixel: Floats
    depth: Floats
    camera: Floats
    pose: Floats
    target: Floats


def _local(state: State, sight: Sight) -> tuple[Floats, Floats]:
    """Targets turned into the rig's axes (n, 3), and in the camera frame (n, 3)."""
    turned = np.einsum("nij,nj->ni", state.attitude[sight.pose], state.target[sight.target])
    offset = turned + state.position[sight.pose] - state.centre[sight.camera]
    return turned, np.einsum("nij,nj->ni", state.rotation[sight.camera], offset)


def project(state: State, sight: Sight) -> tuple[Floats, Floats]:
    """Computed pixels (n, 2) and depths (n,) in mm; pixels are meaningless at depths <= 0."""
    _, local = _local(state, sight)
    depth = local[:, 2]
    safe = np.where(depth > 0.0, depth, 1.0)
    x, y = local[:, 0] / safe, local[:, 1] / safe
    f, cx, cy, k1, k2, p1, p2, k3, b1 = state.interior[sight.camera].T
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.stack([f * (1.0 + b1) * xd + cx, f * yd + cy], axis=1), depth


def partials(state: State, sight: Sight) -> Partials:
    """Pixels with all partials; see :class:`Partials`. Depths must be positive to mean anything."""
    turned, local = _local(state, sight)
    depth = local[:, 2]
    safe = np.where(depth > 0.0, depth, 1.0)
    x, y = local[:, 0] / safe, local[:, 1] / safe
    pixel, interior, by_normalised = _interior_partials(state.interior[sight.camera], x, y)
    by_local = np.empty((len(x), 2, 3))
    by_local[:, :, :2] = by_normalised / safe[:, None, None]
    by_local[:, :, 2] = -(by_local[:, :, 0] * x[:, None] + by_local[:, :, 1] * y[:, None])
    by_point = by_local @ state.rotation[sight.camera]
    camera = np.empty((len(x), 2, PER_CAMERA))
    camera[:, :, :INTERIOR] = interior
    camera[:, :, INTERIOR : INTERIOR + 3] = -by_point
    camera[:, :, INTERIOR + 3 :] = _by_turn(local, by_local)
    pose = np.concatenate([by_point, _by_turn(turned, by_point)], axis=2)
    return Partials(pixel, depth, camera, pose, by_point @ state.attitude[sight.pose])


def _by_turn(vector: Floats, row: Floats) -> Floats:
    """Partials (n, 2, 3) of ``row . exp(w) vector`` by w: ``vector x row``."""
    a, b, c = (vector[:, k, None] for k in range(3))
    p, q, r = row[:, :, 0], row[:, :, 1], row[:, :, 2]
    return np.stack([b * r - c * q, c * p - a * r, a * q - b * p], axis=2)


def _interior_partials(interior: Floats, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Pixels (n, 2), partials by the interior (n, 2, 9) and by normalised x, y (n, 2, 2)."""
    f, cx, cy, k1, k2, p1, p2, k3, b1 = interior.T
    xx, yy, xy = x * x, y * y, x * y
    r2 = xx + yy
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))
    xd = x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * xx)
    yd = y * radial + p1 * (r2 + 2.0 * yy) + 2.0 * p2 * xy
    fx = f * (1.0 + b1)
    out = np.zeros((len(x), 2, INTERIOR))
    out[:, 0, 0], out[:, 1, 0] = (1.0 + b1) * xd, yd
    out[:, 0, 1] = out[:, 1, 2] = 1.0
    power = r2
    for column in (3, 4, 7):
        out[:, 0, column], out[:, 1, column] = fx * x * power, f * y * power
        power = power * r2
    out[:, 0, 5], out[:, 1, 5] = 2.0 * fx * xy, f * (r2 + 2.0 * yy)
    out[:, 0, 6], out[:, 1, 6] = fx * (r2 + 2.0 * xx), 2.0 * f * xy
    out[:, 0, 8] = f * xd
    local = np.empty((len(x), 2, 2))
    cross = xy * slope + 2.0 * p1 * x + 2.0 * p2 * y
    local[:, 0, 0] = fx * (radial + xx * slope + 2.0 * p1 * y + 6.0 * p2 * x)
    local[:, 0, 1] = fx * cross
    local[:, 1, 0] = f * cross
    local[:, 1, 1] = f * (radial + yy * slope + 6.0 * p1 * y + 2.0 * p2 * x)
    return np.stack([fx * xd + cx, f * yd + cy], axis=1), out, local
