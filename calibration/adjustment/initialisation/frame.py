"""The frame and the size that start values are put into."""

from __future__ import annotations

import numpy as np

from calibration.adjustment.camera import CalibratedCamera
from calibration.adjustment.initialisation.resection import RigidTransform
from calibration.adjustment.rotations import similarity
from geometry.arrays import Floats
from geometry.frames import Pose


def moved(
    poses: dict[int, RigidTransform], scale: float, rotation: Floats, translation: Floats
) -> dict[int, RigidTransform]:
    """World-to-camera poses after the world became ``scale rotation x + shift``."""
    return {
        k: RigidTransform(
            p.rotation @ rotation.T,
            scale * p.translation_mm - p.rotation @ rotation.T @ translation,
        )
        for k, p in poses.items()
    }


def centre_of(pose: RigidTransform) -> Floats:
    """Projection centre (3,) of a world-to-camera pose."""
    return np.asarray(-pose.rotation.T @ pose.translation_mm)


def to_start(
    poses: dict[int, RigidTransform], start: tuple[CalibratedCamera, ...], scaled: bool
) -> dict[int, RigidTransform]:
    """Poses put upon the start's: centres and viewing axes as near as a rigid motion brings them.

    ``scaled`` when the size is not known and shall be the start's.
    """
    order = sorted(poses)
    ours = np.stack([centre_of(poses[k]) for k in order])
    theirs = np.stack([start[k].pose.position_rig_mm for k in order])
    scale = 1.0
    if scaled:
        spread = np.linalg.norm(ours - ours.mean(axis=0))
        scale = float(np.linalg.norm(theirs - theirs.mean(axis=0)) / spread)
    reach = float(np.linalg.norm(theirs - theirs.mean(axis=0), axis=1).max()) + 1.0
    # Axes count as points a rig's width away: two centres alone would leave a turn open.
    a = [scale * ours] + [
        scale * ours + reach * np.stack([poses[k].rotation[axis] for k in order])
        for axis in range(3)
    ]
    b = [theirs] + [
        theirs + reach * np.stack([start[k].pose.rotation_rig_to_camera[axis] for k in order])
        for axis in range(3)
    ]
    _, rotation, translation = similarity(np.concatenate(a), np.concatenate(b))
    return moved(poses, scale, rotation, translation)


def upright(poses: dict[int, RigidTransform], middle: Floats) -> dict[int, RigidTransform]:
    """Poses in a rig frame of their own: Z up in the images, Y forward, origin at ``middle``."""
    rotations = np.stack([poses[k].rotation for k in sorted(poses)])
    up = -rotations[:, 1].mean(axis=0)
    up /= np.linalg.norm(up) if np.linalg.norm(up) > 1e-6 else 1.0
    forward = rotations[:, 2].mean(axis=0)
    forward -= (forward @ up) * up
    if np.linalg.norm(forward) < 0.1:
        # Cameras all round: none of the directions is forward, so the first camera's is.
        forward = rotations[0, 2] - (rotations[0, 2] @ up) * up
    forward /= np.linalg.norm(forward)
    rotation = np.stack([np.cross(forward, up), forward, up])
    return moved(poses, 1.0, rotation, -rotation @ middle)


def as_cameras(
    poses: dict[int, RigidTransform], templates: tuple[CalibratedCamera, ...]
) -> tuple[CalibratedCamera, ...]:
    """Cameras with the poses, the rest as in ``templates``."""
    return tuple(
        CalibratedCamera(
            t.name, t.image_size_px, t.interior, Pose(centre_of(poses[k]), poses[k].rotation)
        )
        for k, t in enumerate(templates)
    )
