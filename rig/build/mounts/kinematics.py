"""Chains of links: how a head turns, and which settings bring a camera to a pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from geometry.frames import Pose, pan_tilt_roll_from_rotation
from rig.build.mounts.settings import Link, Motion, chain_pose, pose_of, rig_from_camera, shift

PLATE_FROM_CAMERA = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""A camera on a level head: its x is the plate's x, its z the plate's y, its y the plate's -z."""

ANGLES = ("pan", "tilt", "roll")
LEVER_MM = 300.0
"""A radian of wrong direction counts as much as this many millimetres of wrong place."""

_STEPS = 30
_NEAR_MM = 1e-9


def frame(origin_mm: Floats, x: Floats, y: Floats, z: Floats) -> Floats:
    """A (4, 4) transform whose columns are the given unit vectors and origin."""
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = x, y, z, origin_mm
    return matrix


def standing(normal: Floats, forward: Floats) -> Floats:
    """Rotation (3, 3) of a base whose z is ``normal`` and whose y is nearest to ``forward``."""
    z = np.asarray(normal, dtype=np.float64)
    y = np.asarray(forward, dtype=np.float64) - z * float(z @ forward)
    y = y / np.linalg.norm(y)
    return np.stack([np.cross(y, z), y, z], axis=1)


def rotated(rotation: Floats, origin_mm: Floats | None = None) -> Floats:
    """A (4, 4) transform of a rotation (3, 3) and an origin."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    if origin_mm is not None:
        matrix[:3, 3] = origin_mm
    return matrix


def head_links(
    base: Floats, pivot_mm: float, seat_mm: float, thread_camera_mm: Floats
) -> tuple[Link, ...]:
    """Pan, tilt and roll about a pivot ``pivot_mm`` over the base, then the camera on its plate.

    ``base`` (4, 4): the head's base in the frame before it, z up through the head, y forward.
    ``seat_mm``: base to the mouth of the camera's thread, with all angles at 0.
    """
    seat = rotated(PLATE_FROM_CAMERA, np.array([0.0, 0.0, seat_mm - pivot_mm]))
    return (
        Link(base @ shift(np.array([0.0, 0.0, pivot_mm])), Motion.TURN, -np.eye(3)[2], "pan"),
        Link(np.eye(4), Motion.TURN, np.eye(3)[0], "tilt"),
        Link(np.eye(4), Motion.TURN, np.eye(3)[1], "roll"),
        Link(seat @ shift(-np.asarray(thread_camera_mm))),
    )


def head_angles(rotation_rig_to_camera: Floats, rig_from_base: Floats) -> Floats:
    """Pan, tilt, roll (3,) in degrees of a head on this base (3, 3) for this rotation."""
    return pan_tilt_roll_from_rotation(rotation_rig_to_camera @ rig_from_base)


def turned_over(pose: Pose) -> Pose:
    """The same view with the camera turned by 180 degrees about its axis."""
    return Pose(pose.position_rig_mm, np.diag([-1.0, -1.0, 1.0]) @ pose.rotation_rig_to_camera)


def _difference(pose: Pose, wanted: Pose, with_rotation: bool) -> Floats:
    away = pose.position_rig_mm - wanted.position_rig_mm
    if not with_rotation:
        return away
    turn = pose.rotation_rig_to_camera.T @ wanted.rotation_rig_to_camera
    skew = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return np.concatenate([away, 0.5 * LEVER_MM * skew])


def reach(
    chain: tuple[Link, ...],
    values: Mapping[str, float],
    names: Sequence[str],
    wanted: Pose,
    *,
    with_rotation: bool = True,
) -> dict[str, float]:
    """Values of the settings ``names`` that bring the chain's end to ``wanted``.

    The others stay; without rotation only the place counts. Damped Gauss-Newton from
    ``values``. Raises :class:`InputError` when the chain cannot get there.
    """
    found = dict(values)
    error = _difference(chain_pose(chain, found), wanted, with_rotation)
    for _ in range(_STEPS):
        if float(np.linalg.norm(error)) < _NEAR_MM:
            return found
        jacobian = pose_jacobian(chain, found, names, with_rotation)
        step = -np.linalg.lstsq(jacobian, error, rcond=None)[0]
        scale = 1.0
        while scale > 1e-3:
            trial = found | {
                n: found[n] + scale * float(d) for n, d in zip(names, step, strict=True)
            }
            now = _difference(chain_pose(chain, trial), wanted, with_rotation)
            if np.linalg.norm(now) < np.linalg.norm(error):
                break
            scale *= 0.5
        else:
            break
        found, error = trial, now
    left = float(np.linalg.norm(error))
    if left < 1e-6:
        return found
    raise InputError(
        "mount-reach",
        f"the mount stays {left:.1f} mm short of the pose it should reach",
        "choose another mount or another design",
    )


def frames_along(chain: tuple[Link, ...], values: Mapping[str, float]) -> list[Floats]:
    """Each link's own frame (4, 4) in the rig frame, before its motion; then the camera's."""
    matrix, frames = np.eye(4), []
    for link in chain:
        frames.append(matrix @ link.transform)
        matrix = matrix @ link.matrix(values[link.setting] if link.setting else 0.0)
    return [*frames, matrix]


def pose_jacobian(
    chain: tuple[Link, ...], values: Mapping[str, float], names: Sequence[str], with_rotation: bool
) -> Floats:
    """Derivatives (3, m) of the camera's place by the settings; (6, m) with its rotation."""
    frames = frames_along(chain, values)
    end = frames[-1][:3, 3]
    rows = np.zeros((6 if with_rotation else 3, len(names)))
    for link, at in zip(chain, frames, strict=False):
        if link.setting not in names or link.axis is None:
            continue
        axis = at[:3, :3] @ link.axis
        column = names.index(link.setting)
        if link.motion is Motion.SLIDE:
            rows[:3, column] += link.per_unit * axis
        else:
            rate = np.radians(link.per_unit)
            rows[:3, column] += rate * np.cross(axis, end - at[:3, 3])
            if with_rotation:
                rows[3:, column] += rate * LEVER_MM * axis
    return rows


def keeping_aim(pose: Pose, rotation: Floats, target_mm: Floats) -> Pose:
    """The pose with another rotation that still sees ``target_mm`` at the same pixel and depth."""
    local = pose.to_camera(target_mm[None])[0]
    return Pose(target_mm - rotation.T @ local, rotation)


def rotation_at(chain: tuple[Link, ...], values: Mapping[str, float]) -> Floats:
    """``rotation_rig_to_camera`` (3, 3) at the end of a chain."""
    return chain_pose(chain, values).rotation_rig_to_camera


__all__ = [
    "ANGLES",
    "PLATE_FROM_CAMERA",
    "frame",
    "frames_along",
    "head_angles",
    "head_links",
    "keeping_aim",
    "pose_jacobian",
    "pose_of",
    "reach",
    "rig_from_camera",
    "rotated",
    "rotation_at",
    "standing",
    "turned_over",
]
