"""Frames and rotations: the one module of conventions.

Rig frame: right-handed, millimetres, X to the subject's left, Z up, Y from the cameras
towards the subject. A face looks along -Y; cameras stand at negative Y.

Camera frame: x right, y down, z forward (OpenCV), pixel centres at integers.
``rotation_rig_to_camera`` R maps directions: ``x_camera = R (X_rig - C)``.

Photogrammetric angles: ``M = Mk(kappa) Mp(phi) Mw(omega)``, the camera looking along -z of
M; ``R = diag(1, -1, -1) M``. Degrees at every boundary, radians only inside functions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, frozen

PHOTO_TO_CV = frozen(np.diag([1.0, -1.0, -1.0]))
"""Maps the photogrammetric image frame (x right, y up, looking along -z) to OpenCV's."""

FORWARD_RIG = frozen([0.0, -1.0, 0.0])
"""The direction in which a face looks, in the rig frame."""

_ORTHOGONALITY_TOLERANCE = 1e-9


def rotation_omega(omega_rad: float) -> Floats:
    """Elementary rotation about X, (3, 3)."""
    c, s = np.cos(omega_rad), np.sin(omega_rad)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])


def rotation_phi(phi_rad: float) -> Floats:
    """Elementary rotation about Y, (3, 3)."""
    c, s = np.cos(phi_rad), np.sin(phi_rad)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def rotation_kappa(kappa_rad: float) -> Floats:
    """Elementary rotation about Z, (3, 3)."""
    c, s = np.cos(kappa_rad), np.sin(kappa_rad)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_from_omega_phi_kappa(omega_phi_kappa_deg: Floats) -> Floats:
    """``rotation_rig_to_camera`` (3, 3) from the three photogrammetric angles in degrees."""
    omega, phi, kappa = np.radians(np.asarray(omega_phi_kappa_deg, dtype=np.float64))
    m = rotation_kappa(kappa) @ rotation_phi(phi) @ rotation_omega(omega)
    return PHOTO_TO_CV @ m


def omega_phi_kappa_from_rotation(rotation_rig_to_camera: Floats) -> Floats:
    """Omega, phi, kappa in degrees, (3,); phi within [-90, 90].

    At phi = +-90 degrees omega and kappa turn about one axis; omega is then set to 0.
    """
    m = PHOTO_TO_CV @ rotation_rig_to_camera
    phi = np.arcsin(np.clip(m[2, 0], -1.0, 1.0))
    if np.hypot(m[0, 0], m[1, 0]) < 1e-12:
        omega, kappa = 0.0, np.arctan2(m[0, 1], m[1, 1])
    else:
        omega = np.arctan2(-m[2, 1], m[2, 2])
        kappa = np.arctan2(-m[1, 0], m[0, 0])
    return np.asarray(np.degrees([omega, phi, kappa]))


def look_at_rotation(
    position_rig_mm: Floats, target_rig_mm: Floats, roll_deg: float = 0.0
) -> Floats:
    """``rotation_rig_to_camera`` (3, 3) of a camera that looks from position to target.

    At roll 0 the image's x axis is level and its y axis points down; positive roll turns the
    camera clockwise as seen from behind it. Looking straight up or down, x is the rig's X.
    """
    forward = np.asarray(target_rig_mm, dtype=np.float64) - position_rig_mm
    distance = float(np.linalg.norm(forward))
    if distance == 0.0:
        raise InputError(
            "pose-degenerate", "a camera stands on the point it looks at", "move one of them"
        )
    forward = forward / distance
    right = np.array([forward[1], 0.0 - forward[0], 0.0])
    length = float(np.linalg.norm(right))
    right = np.array([1.0, 0.0, 0.0]) if length < 1e-9 else right / length
    down = _cross(forward, right)
    roll = np.radians(roll_deg)
    x_axis = np.cos(roll) * right + np.sin(roll) * down
    return np.array([x_axis, _cross(forward, x_axis), forward])


def _cross(a: Floats, b: Floats) -> Floats:
    """Product of two vectors (3,): a search asks for thousands, and NumPy's is made for many."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def pan_tilt_roll_from_rotation(rotation_rig_to_camera: Floats) -> Floats:
    """Pan, tilt, roll in degrees, (3,), as a person sets them on a head.

    From a camera that looks along +Y, level: pan to the right (as seen from behind the
    camera, towards +X) positive, then tilt up positive, then roll clockwise positive.
    """
    forward = rotation_rig_to_camera[2]
    pan = np.degrees(np.arctan2(forward[0], forward[1]))
    tilt = np.degrees(np.arcsin(np.clip(forward[2], -1.0, 1.0)))
    level = look_at_rotation(np.zeros(3), forward)
    x_axis = rotation_rig_to_camera[0]
    roll = np.degrees(np.arctan2(x_axis @ level[1], x_axis @ level[0]))
    return np.array([pan, tilt, roll])


def rotation_from_pan_tilt_roll(pan_tilt_roll_deg: Floats) -> Floats:
    """Inverse of :func:`pan_tilt_roll_from_rotation`, (3, 3)."""
    pan, tilt, roll = (float(v) for v in pan_tilt_roll_deg)
    p, t = np.radians(pan), np.radians(tilt)
    forward = np.array([np.cos(t) * np.sin(p), np.cos(t) * np.cos(p), np.sin(t)])
    return look_at_rotation(np.zeros(3), forward, roll)


@dataclass(frozen=True, eq=False)
class Pose:
    """Exterior orientation of one camera.

    ``position_rig_mm`` (3,) is the projection centre, ``rotation_rig_to_camera`` (3, 3) a
    proper rotation. Raises :class:`InputError` when either is not finite or not a rotation.
    """

    position_rig_mm: Floats
    rotation_rig_to_camera: Floats

    def __post_init__(self) -> None:
        position, rotation = frozen(self.position_rig_mm), frozen(self.rotation_rig_to_camera)
        remedy = "give a finite position (3 numbers) and a proper rotation (3 x 3, determinant +1)"
        if position.shape != (3,) or rotation.shape != (3, 3):
            raise InputError("pose-shape", "a pose has the wrong shape", remedy)
        if not (np.isfinite(position).all() and np.isfinite(rotation).all()):
            raise InputError("pose-not-finite", "a pose holds NaN or infinity", remedy)
        off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        if off > _ORTHOGONALITY_TOLERANCE or np.linalg.det(rotation) < 0.0:
            raise InputError(
                "pose-not-a-rotation", "the matrix of a pose is not a rotation", remedy
            )
        object.__setattr__(self, "position_rig_mm", position)
        object.__setattr__(self, "rotation_rig_to_camera", rotation)

    @classmethod
    def looking_at(
        cls, position_rig_mm: Floats, target_rig_mm: Floats, roll_deg: float = 0.0
    ) -> Self:
        """A camera at ``position_rig_mm`` that looks at ``target_rig_mm``."""
        position = np.asarray(position_rig_mm, dtype=np.float64)
        return cls(position, look_at_rotation(position, target_rig_mm, roll_deg))

    @classmethod
    def from_omega_phi_kappa(cls, position_rig_mm: Floats, omega_phi_kappa_deg: Floats) -> Self:
        """A pose from photogrammetric angles in degrees."""
        return cls(np.asarray(position_rig_mm), rotation_from_omega_phi_kappa(omega_phi_kappa_deg))

    @property
    def omega_phi_kappa_deg(self) -> Floats:
        """Photogrammetric angles in degrees, (3,)."""
        return omega_phi_kappa_from_rotation(self.rotation_rig_to_camera)

    @property
    def pan_tilt_roll_deg(self) -> Floats:
        """Pan, tilt and roll in degrees, (3,)."""
        return pan_tilt_roll_from_rotation(self.rotation_rig_to_camera)

    @property
    def axis_rig(self) -> Floats:
        """Unit vector along the optical axis, away from the camera, (3,)."""
        return np.asarray(self.rotation_rig_to_camera[2])

    def to_camera(self, points_rig_mm: Floats) -> Floats:
        """Points (N, 3) of the rig frame in the camera frame, (N, 3), millimetres."""
        return (np.asarray(points_rig_mm) - self.position_rig_mm) @ self.rotation_rig_to_camera.T

    def to_rig(self, points_camera_mm: Floats) -> Floats:
        """Points (N, 3) of the camera frame in the rig frame, (N, 3), millimetres."""
        return np.asarray(points_camera_mm) @ self.rotation_rig_to_camera + self.position_rig_mm
