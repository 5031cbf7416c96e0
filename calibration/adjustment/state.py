"""Values of all unknowns of an adjustment at one moment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import INTERIOR, PER_CAMERA, CalibratedCamera, Interior
from calibration.adjustment.rotations import nearest_rotation, rotation_of
from geometry.arrays import Floats, Ints
from geometry.frames import Pose


@dataclass(frozen=True, eq=False)
class State:
    """Cameras, places of carriers, targets.

    ``interior`` (n, 13); ``centre`` (n, 3) mm and ``rotation`` (n, 3, 3) rig to camera;
    ``position`` (k, 3) and ``attitude`` (k, 3, 3) of carriers: ``X_rig = attitude x + position``;
    ``target`` (m, 3) in the frame of its carrier.
    """

    interior: Floats
    centre: Floats
    rotation: Floats
    position: Floats
    attitude: Floats
    target: Floats

    def moved(self, core: Floats, target: Floats) -> State:
        """After a step: ``core`` (19 n + 6 k,) of cameras and carriers, ``target`` (m, 3)."""
        count = len(self.interior)
        cameras = core[: PER_CAMERA * count].reshape(count, PER_CAMERA)
        carriers = core[PER_CAMERA * count :].reshape(len(self.position), 6)
        return State(
            self.interior + cameras[:, :INTERIOR],
            self.centre + cameras[:, INTERIOR : INTERIOR + 3],
            rotation_of(cameras[:, INTERIOR + 3 :]) @ self.rotation,
            self.position + carriers[:, :3],
            rotation_of(carriers[:, 3:]) @ self.attitude,
            self.target + target,
        )

    def points_rig_mm(self, pose: Ints, target: Ints) -> Floats:
        """Targets in the rig frame (n, 3); ``pose`` and ``target`` (n,) index carriers, targets."""
        rotated = np.einsum("nij,nj->ni", self.attitude[pose], self.target[target])
        return np.asarray(rotated + self.position[pose])

    def cameras(
        self, names: tuple[str, ...], sizes_px: tuple[tuple[int, int], ...]
    ) -> tuple[CalibratedCamera, ...]:
        """The cameras as objects."""
        return tuple(
            CalibratedCamera(
                name,
                size,
                Interior.of(self.interior[k]),
                # Many small turns one after the other drift off a rotation by rounding.
                Pose(self.centre[k], nearest_rotation(self.rotation[k])),
            )
            for k, (name, size) in enumerate(zip(names, sizes_px, strict=True))
        )


def camera_arrays(cameras: tuple[CalibratedCamera, ...]) -> tuple[Floats, Floats, Floats]:
    """``interior`` (n, 13), ``centre`` (n, 3), ``rotation`` (n, 3, 3) of cameras."""
    return (
        np.stack([c.interior.vector for c in cameras]),
        np.stack([c.pose.position_rig_mm for c in cameras]),
        np.stack([c.pose.rotation_rig_to_camera for c in cameras]),
    )
