"""Camera bodies in their places, and how far apart they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.solids.convex import box_corners, cylinder_corners, signed_distance


@dataclass(frozen=True, eq=False)
class PlacedBody:
    """The convex parts of one camera's body, corners in the rig frame, millimetres.

    ``parts`` holds the box (8, 3) and, when there is a lens, the prism about it (K, 3).
    ``centre_mm`` (3,) and ``radius_mm`` bound them all.
    """

    name: str
    parts: tuple[Floats, ...]
    centre_mm: Floats
    radius_mm: float


def place_body(rig_camera: RigCamera) -> PlacedBody:
    """The body of a camera where it stands."""
    body, pose = rig_camera.camera.body, rig_camera.pose
    parts = [box_corners(body.size_mm, body.centre_camera_mm)]
    if body.lens_diameter_mm > 0.0 and body.lens_length_mm > 0.0:
        front = body.front_z_mm
        parts.append(cylinder_corners(body.lens_diameter_mm, front, front + body.lens_length_mm))
    placed = tuple(pose.to_rig(part) for part in parts)
    corners = np.concatenate(placed)
    centre = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
    radius = float(np.linalg.norm(corners - centre, axis=1).max())
    return PlacedBody(rig_camera.name, placed, centre, radius)


def body_clearance_mm(one: PlacedBody, other: PlacedBody) -> float:
    """Gap between two bodies; negative when they overlap."""
    return min(signed_distance(a, b) for a in one.parts for b in other.parts)


def clearance_table_mm(bodies: tuple[PlacedBody, ...]) -> Floats:
    """Symmetric table (n, n) of gaps between bodies; infinity on the diagonal."""
    table = np.full((len(bodies), len(bodies)), np.inf)
    for i, one in enumerate(bodies):
        for j in range(i):
            table[i, j] = table[j, i] = body_clearance_mm(one, bodies[j])
    return table
