"""The unknowns of a network and the rotations they stand for, with two derivatives.

Each camera has seven unknowns: three angles, three coordinates, one focus distance. The
angles multiply a base rotation, ``M = Mk(k) Mp(p) Mw(w) M0``: with M0 the start's own
rotation the angles stay near zero, far from gimbal lock; with M0 = I they are the paper's
omega, phi, kappa, which is what bounds on those angles (Eq 8) need. Lengths are divided by
``length_mm`` so that all unknowns are of order one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats, Ints
from geometry.frames import PHOTO_TO_CV, Pose

PER_CAMERA = 7
ANGLES = slice(0, 3)
POSITION = slice(3, 6)
KAPPA, FOCUS = 2, 6


def _elementary(angles: Floats, axis: int) -> tuple[Floats, Floats, Floats]:
    """Elementary rotations (n, 3, 3) by omega (axis 0), phi or kappa, with two derivatives."""
    c, s = np.cos(angles), np.sin(angles)
    sign = -1.0 if axis == 1 else 1.0
    i, j = [(1, 2), (0, 2), (0, 1)][axis]
    value, first = np.zeros((len(angles), 3, 3)), np.zeros((len(angles), 3, 3))
    value[:, axis, axis] = 1.0
    value[:, i, i] = value[:, j, j] = c
    value[:, i, j], value[:, j, i] = sign * s, -sign * s
    first[:, i, i] = first[:, j, j] = -s
    first[:, i, j], first[:, j, i] = sign * c, -sign * c
    second = -value
    second[:, axis, axis] = 0.0
    return value, first, second


@dataclass(frozen=True, eq=False)
class NetworkState:
    """Poses at one value of the unknowns.

    ``rotation`` (n, 3, 3) rig to camera; ``rotation_1`` (n, 3, 3, 3) its derivatives by the
    three angles; ``rotation_2`` (n, 3, 3, 3, 3) the second ones; ``centre`` (n, 3) and
    ``focus`` (n,) in units of the length scale.
    """

    rotation: Floats
    rotation_1: Floats
    rotation_2: Floats
    centre: Floats
    focus: Floats

    @property
    def axis(self) -> Floats:
        """Optical axes, (n, 3)."""
        return self.rotation[:, 2, :]


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Maps the vector of all unknowns (7 n,) to poses and back.

    ``base`` (n, 3, 3) are the M0, ``origin_mm`` (3,) the point about which lengths are scaled
    by ``length_mm``. ``free`` holds the indices of the unknowns that may change.
    """

    base: Floats
    origin_mm: Floats
    length_mm: float
    free: Ints

    @property
    def count(self) -> int:
        """Number of cameras."""
        return len(self.base)

    def pack(self, poses: tuple[Pose, ...], focus_mm: Floats) -> Floats:
        """All unknowns (7 n,) of the given poses and focus distances."""
        values = np.empty((self.count, PER_CAMERA))
        for k, pose in enumerate(poses):
            relative = PHOTO_TO_CV @ pose.rotation_rig_to_camera @ self.base[k].T
            phi = np.arcsin(np.clip(relative[2, 0], -1.0, 1.0))
            values[k, 0] = np.arctan2(-relative[2, 1], relative[2, 2])
            values[k, 1] = phi
            values[k, 2] = np.arctan2(-relative[1, 0], relative[0, 0])
            values[k, POSITION] = (pose.position_rig_mm - self.origin_mm) / self.length_mm
        values[:, FOCUS] = np.asarray(focus_mm) / self.length_mm
        return values.ravel()

    def unpack(self, values: Floats) -> tuple[tuple[Pose, ...], Floats]:
        """Poses and focus distances (n,) in mm of all unknowns (7 n,)."""
        state = self.state(values)
        poses = []
        for k in range(self.count):
            # Products of rotations drift by rounding; a pose must be a rotation to 1e-9.
            u, _, vt = np.linalg.svd(state.rotation[k])
            poses.append(Pose(state.centre[k] * self.length_mm + self.origin_mm, u @ vt))
        return tuple(poses), state.focus * self.length_mm

    def state(self, values: Floats) -> NetworkState:
        """Rotations with two derivatives, centres and focus distances."""
        table = np.reshape(values, (self.count, PER_CAMERA))
        w, p, k = (_elementary(table[:, axis], axis) for axis in range(3))

        def product(orders: Ints) -> Floats:
            return np.asarray(
                PHOTO_TO_CV @ (k[orders[2]] @ p[orders[1]] @ w[orders[0]] @ self.base)
            )

        once = np.eye(3, dtype=np.int64)
        first = np.stack([product(once[a]) for a in range(3)], axis=1)
        second = np.empty((self.count, 3, 3, 3, 3))
        for a in range(3):
            for b in range(a, 3):
                second[:, a, b] = second[:, b, a] = product(once[a] + once[b])
        rotation = product(np.zeros(3, dtype=np.int64))
        return NetworkState(rotation, first, second, table[:, POSITION], table[:, FOCUS])
