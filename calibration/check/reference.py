"""The reference as a check needs it: values, and a root of their covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import PER_CAMERA
from calibration.adjustment.result import Calibration
from calibration.adjustment.state import State, camera_arrays
from geometry.arrays import Floats, Ints

RANK = 1e-13
"""Directions of the covariance below this share of the largest are the datum's defect."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Values and uncertainty of a calibration.

    ``interior`` (n, 13), ``centre`` (n, 3), ``rotation`` (n, 3, 3), ``target`` (m, 3) of the
    used targets; ``root`` (19 n + 3 m, r) with ``root root^T`` their covariance.
    """

    interior: Floats
    centre: Floats
    rotation: Floats
    target: Floats
    root: Floats

    @classmethod
    def of(cls, calibration: Calibration, targets: Ints) -> Reference:
        """Of some of the targets of a calibration, by their indices (m,)."""
        covariance = calibration.covariance
        size = PER_CAMERA * covariance.camera_count
        columns = np.concatenate(
            [np.arange(size), (size + 3 * targets[:, None] + np.arange(3)).ravel()]
        )
        joint = covariance.joint()[np.ix_(columns, columns)]
        return cls(
            *camera_arrays(calibration.cameras), calibration.target_mm[targets], root_of(joint)
        )

    def state(self, position: Floats, attitude: Floats) -> State:
        """With carriers in their places."""
        return State(self.interior, self.centre, self.rotation, position, attitude, self.target)

    def drawn(self, rng: np.random.Generator) -> Reference:
        """Another reference that the same truth could have led to: a draw from the covariance."""
        change = self.root @ rng.normal(size=self.root.shape[1])
        size = PER_CAMERA * len(self.interior)
        nowhere = self.state(np.zeros((0, 3)), np.zeros((0, 3, 3)))
        moved = nowhere.moved(change[:size], change[size:].reshape(-1, 3))
        return Reference(moved.interior, moved.centre, moved.rotation, moved.target, self.root)


def root_of(covariance: Floats) -> Floats:
    """A matrix (p, r) whose product with its transpose is the covariance (p, p) of rank r."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    used = np.flatnonzero(scale > 0.0)
    correlation = covariance[np.ix_(used, used)] / np.outer(scale[used], scale[used])
    sizes, axes = np.linalg.eigh(correlation)
    good = sizes > RANK * sizes.max(initial=0.0)
    root = np.zeros((len(covariance), int(good.sum())))
    root[used] = axes[:, good] * np.sqrt(sizes[good]) * scale[used][:, None]
    return root
