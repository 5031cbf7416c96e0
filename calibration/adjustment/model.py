"""The collinearity equations of targets on placed carriers, and their closed-form partials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.adjustment.camera import INTERIOR, PER_CAMERA
from calibration.adjustment.state import State
from geometry.arrays import Floats, Ints
from geometry.camera import project as image_of
from geometry.camera import project_partials, rotation_partials


@dataclass(frozen=True, eq=False)
class ObservationIndex:
    """Which camera saw which target of which placed carrier; all (n,)."""

    camera: Ints
    pose: Ints
    target: Ints


@dataclass(frozen=True, eq=False)
class Partials:
    """Computed pixels (n, 2), depths (n,) and partials of the pixels.

    ``camera`` (n, 2, 19) by interior and exterior orientation, ``pose`` (n, 2, 6) by translation
    and rotation of the carrier in the rig frame, ``target`` (n, 2, 3) in the carrier's frame.
    """

    pixel: Floats
    depth_mm: Floats
    camera: Floats
    pose: Floats
    target: Floats


def _local(state: State, observed: ObservationIndex) -> tuple[Floats, Floats]:
    """Targets rotated into the rig's axes (n, 3), and in the camera frame (n, 3)."""
    rotated = np.einsum("nij,nj->ni", state.attitude[observed.pose], state.target[observed.target])
    offset = rotated + state.position[observed.pose] - state.centre[observed.camera]
    return rotated, np.einsum("nij,nj->ni", state.rotation[observed.camera], offset)


def project(state: State, observed: ObservationIndex) -> tuple[Floats, Floats]:
    """Computed pixels (n, 2) and depths (n,) in mm; pixels are meaningless at depths <= 0."""
    _, local = _local(state, observed)
    return image_of(local, state.interior[observed.camera])


def partials(state: State, observed: ObservationIndex) -> Partials:
    """Pixels with all partials; see :class:`Partials`. Depths must be positive to mean anything."""
    rotated, local = _local(state, observed)
    image = project_partials(
        local, state.rotation[observed.camera], state.interior[observed.camera]
    )
    camera = np.empty((len(local), 2, PER_CAMERA))
    camera[:, :, :INTERIOR] = image.by_interior
    camera[:, :, INTERIOR:] = image.by_pose
    pose = np.concatenate([image.by_point, rotation_partials(rotated, image.by_point)], axis=2)
    target = image.by_point @ state.attitude[observed.pose]
    return Partials(image.pixels, image.depth_mm, camera, pose, target)
