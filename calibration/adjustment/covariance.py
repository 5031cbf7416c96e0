"""The full covariance of an adjustment, kept in the parts it is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import PER_CAMERA
from calibration.adjustment.network import Network
from geometry.arrays import Floats, Ints, frozen, frozen_ints


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of cameras, placed carriers and targets; mm, px and radians.

    ``core`` (r, r): the cameras (19 each), the carriers (6 each), the kept targets (3 each).
    An eliminated target is ``effect`` (3 e, r) times the core plus a part of its own with
    covariance ``own`` (e, 3, 3). ``kept`` (k,) and ``eliminated`` (e,) are target indices.
    Held unknowns have zeros.
    """

    camera_count: int
    pose_count: int
    kept: Ints
    eliminated: Ints
    core: Floats
    effect: Floats
    own: Floats

    def __post_init__(self) -> None:
        for name in ("core", "effect", "own"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        for name in ("kept", "eliminated"):
            object.__setattr__(self, name, frozen_ints(getattr(self, name)))

    @classmethod
    def built(cls, network: Network, core: Floats, effect: Floats, own: Floats) -> Covariance:
        """From inverted normal equations: what is held has a one there and gets a zero."""
        free = np.concatenate([network.core_free, network.target_free[network.kept].ravel()])
        loose = network.target_free[network.eliminated]
        return cls(
            network.camera_count,
            network.pose_count,
            network.kept,
            network.eliminated,
            core * free[:, None] * free,
            effect * loose.reshape(-1, 1),
            own * loose[:, :, None] * loose[:, None, :],
        )

    @property
    def target_count(self) -> int:
        """Number of targets."""
        return len(self.kept) + len(self.eliminated)

    @property
    def cameras(self) -> Floats:
        """Of all camera parameters, (19 n, 19 n)."""
        size = PER_CAMERA * self.camera_count
        return self.core[:size, :size]

    def camera(self, index: int) -> Floats:
        """Of one camera's parameters, (19, 19)."""
        place = slice(PER_CAMERA * index, PER_CAMERA * (index + 1))
        return self.core[place, place]

    def target_rows(self) -> Floats:
        """Targets, in their order, as rows (3 m, r) on the core; own parts come on top."""
        rows = np.zeros((self.target_count, 3, len(self.core)))
        first = PER_CAMERA * self.camera_count + 6 * self.pose_count
        for k, target in enumerate(self.kept):
            rows[target, :, first + 3 * k : first + 3 * k + 3] = np.eye(3)
        rows[self.eliminated] = self.effect.reshape(-1, 3, len(self.core))
        return rows.reshape(3 * self.target_count, len(self.core))

    def own_blocks(self) -> Floats:
        """Own parts (m, 3, 3) of all targets in their order; zero of kept ones."""
        blocks = np.zeros((self.target_count, 3, 3))
        blocks[self.eliminated] = self.own
        return blocks

    def targets(self) -> Floats:
        """Of each target for itself, (m, 3, 3), mm^2."""
        rows = self.target_rows().reshape(self.target_count, 3, len(self.core))
        return np.asarray((rows @ self.core) @ np.swapaxes(rows, 1, 2) + self.own_blocks())

    def joint(self) -> Floats:
        """Of all cameras and then all targets in their order, (19 n + 3 m, 19 n + 3 m)."""
        size = PER_CAMERA * self.camera_count
        rows = np.concatenate([np.eye(size, len(self.core)), self.target_rows()])
        out = rows @ self.core @ rows.T
        blocks = self.own_blocks()
        for k in range(self.target_count):
            place = slice(size + 3 * k, size + 3 * k + 3)
            out[place, place] += blocks[k]
        return np.asarray(out)

    def of_functions(self, by_cameras: Floats, by_targets: Floats) -> Floats:
        """Of functions with partials (q, 19 n) by cameras and (q, m, 3) by targets, (q, q)."""
        size = PER_CAMERA * self.camera_count
        rows = by_targets.reshape(len(by_targets), 3 * self.target_count) @ self.target_rows()
        rows[:, :size] += by_cameras
        own = np.einsum("qma,mab,smb->qs", by_targets, self.own_blocks(), by_targets)
        return np.asarray(rows @ self.core @ rows.T + own)

    def scaled(self, factor: float) -> Covariance:
        """All variances times ``factor``."""
        return Covariance(
            self.camera_count,
            self.pose_count,
            self.kept,
            self.eliminated,
            self.core * factor,
            self.effect,
            self.own * factor,
        )
