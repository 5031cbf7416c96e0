"""Rigid motions: where the head is at an instant, and where a camera is that was knocked."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.simulation.settings import MotionSettings


@dataclass(frozen=True, eq=False)
class HeadPlacement:
    """A rigid placement: ``x_rig = rotation @ x_rest + shift_mm``, (3, 3) and (3,)."""

    rotation: Floats
    shift_mm: Floats

    def to_rest(self, points_rig_mm: Floats) -> Floats:
        """Points (..., 3) of the rig frame in the frame of the head at rest."""
        return np.asarray((points_rig_mm - self.shift_mm) @ self.rotation)

    def to_rig(self, points_rest_mm: Floats) -> Floats:
        """Inverse of :meth:`to_rest`."""
        return np.asarray(points_rest_mm @ self.rotation.T + self.shift_mm)


def placement_at(motion: MotionSettings, time_s: float) -> HeadPlacement:
    """Where the head is ``time_s`` after (or before) it was at rest in its place."""
    turn = np.radians(np.array(motion.angular_velocity_deg_s)) * time_s
    return HeadPlacement(rotation_by(turn), np.array(motion.velocity_mm_s) * time_s)


def rotation_by(turn_rad: Floats) -> Floats:
    """The rotation (3, 3) by a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(turn_rad))
    if angle < 1e-15:
        return np.eye(3)
    x, y, z = turn_rad / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def knocked(
    rig_camera: RigCamera,
    moved_mm: tuple[float, float, float],
    turned_deg: tuple[float, float, float],
) -> RigCamera:
    """The camera moved along and turned (a rotation vector) about its own axes."""
    if not any((*moved_mm, *turned_deg)):
        return rig_camera
    pose = rig_camera.pose
    turn = rotation_by(np.radians(np.array(turned_deg)))
    position = pose.to_rig(np.array([moved_mm]))[0]
    return replace(rig_camera, pose=Pose(position, turn.T @ pose.rotation_rig_to_camera))
