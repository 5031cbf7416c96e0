"""The convex solids of what is mounted: bars, boxes, round parts, cameras with lens and cable."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.build.mounts.kinematics import rotated
from rig.build.mounts.structure import Solid
from rig.solids.convex import box_corners

SIDES = 12
"""Sides of the prism about a round part: circumscribed, 3.5 % too large at its corners."""

CABLE_MM = (14.0, 35.0)
"""A plug and the start of its cable behind a camera: width, and length before it may bend."""


def carried(transform: Floats, points: Floats) -> Floats:
    """Points (n, 3) of a frame in the frame that ``transform`` (4, 4) leads to."""
    return np.asarray(points @ transform[:3, :3].T + transform[:3, 3])


def box(owner: str, kind: str, at: Floats, low_mm: Floats, high_mm: Floats) -> Solid:
    """A box from corner to corner in the frame ``at`` (4, 4)."""
    low, high = np.asarray(low_mm, dtype=np.float64), np.asarray(high_mm, dtype=np.float64)
    return Solid(owner, kind, carried(at, box_corners(high - low, (low + high) / 2.0)))


def round_part(
    owner: str, kind: str, at: Floats, diameter_mm: float, low_mm: float, high_mm: float
) -> Solid:
    """A cylinder about the z axis of the frame ``at`` (4, 4)."""
    turn = 2.0 * np.pi * (np.arange(SIDES) + 0.5) / SIDES
    radius = diameter_mm / 2.0 / np.cos(np.pi / SIDES)
    ring = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.zeros(SIDES)], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    return Solid(
        owner, kind, carried(at, np.concatenate([ring + low_mm * up, ring + high_mm * up]))
    )


def bar(
    owner: str,
    kind: str,
    start_mm: Floats,
    end_mm: Floats,
    across: Floats,
    size_mm: tuple[float, float],
) -> Solid:
    """A straight bar; ``size_mm`` along ``across`` and at right angles to it."""
    along = np.asarray(end_mm, dtype=np.float64) - start_mm
    length = float(np.linalg.norm(along))
    z = along / length
    at = rotated(np.stack([across, np.cross(z, across), z], axis=1), start_mm)
    half = np.array([size_mm[0] / 2.0, size_mm[1] / 2.0, 0.0])
    return box(owner, kind, at, -half, half + np.array([0.0, 0.0, length]))


def camera_solids(camera: RigCamera) -> tuple[Solid, ...]:
    """Body, lens and cable of a camera where it stands."""
    body, name = camera.camera.body, camera.name
    at = rotated(camera.pose.rotation_rig_to_camera.T, camera.pose.position_rig_mm)
    half = body.size_mm / 2.0
    low, high = body.centre_camera_mm - half, body.centre_camera_mm + half
    width, length = CABLE_MM
    plug = np.array([width / 2.0, width / 2.0, 0.0])
    back = np.array([body.centre_camera_mm[0], body.centre_camera_mm[1], low[2]])
    out = [box(name, "camera", at, low, high)]
    if body.lens_diameter_mm > 0.0 and body.lens_length_mm > 0.0:
        front = body.front_z_mm
        out.append(
            round_part(name, "lens", at, body.lens_diameter_mm, front, front + body.lens_length_mm)
        )
    out.append(box(name, "cable", at, back - plug - np.array([0.0, 0.0, length]), back + plug))
    return tuple(out)


def lens_front(camera: RigCamera) -> Floats:
    """The middle of the lens's front, of the body's where there is no lens, (3,)."""
    body = camera.camera.body
    return np.asarray(
        camera.pose.to_rig(np.array([[0.0, 0.0, body.front_z_mm + body.lens_length_mm]]))[0]
    )
