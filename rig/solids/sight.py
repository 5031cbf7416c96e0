"""What each camera sees, and the volume that must stay free for it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from geometry.arrays import Bools, Floats, Ints
from geometry.camera import RigCamera, perspective
from geometry.raycast import Occluder
from geometry.surface import SurfacePoints
from rig.solids.bodies import PlacedBody
from rig.solids.convex import signed_distance


def seen_by(
    rig_camera: RigCamera,
    points: SurfacePoints,
    occluder: Occluder,
    ray_max_deg: float,
    *,
    in_frame: bool = True,
) -> Bools:
    """Which points (N,) the camera sees: within the incidence limit, not hidden, in its image.

    With ``in_frame`` False the image has no border.
    """
    pixels, depth = rig_camera.camera.project(rig_camera.pose, points.points_mm)
    half = np.array(rig_camera.camera.image_size_px) / 2.0
    way = rig_camera.pose.position_rig_mm - points.points_mm
    cosine = np.einsum("ij,ij->i", way, points.normals) / np.linalg.norm(way, axis=1)
    seen = np.asarray((depth > 0.0) & (cosine >= np.cos(np.radians(ray_max_deg))))
    if in_frame:
        # NaN pixels lie behind the camera, where the depth already rules them out.
        seen &= (np.abs(pixels + 0.5 - half) <= half).all(axis=1)
    if seen.any():
        eye = rig_camera.pose.position_rig_mm
        seen[seen] = ~occluder.hidden(points.points_mm[seen], points.normals[seen], eye)
    return seen


def outline(points: Floats) -> Floats:
    """Corners (K, 2) of the convex hull of image points (N, 2), in order."""
    return np.asarray(points[_edge(points)])


def _edge(points: Floats) -> Ints:
    """Indices of the corners of the convex hull; all of them when there is no area to outline."""
    try:
        return np.asarray(ConvexHull(points).vertices, dtype=np.int64)
    except (QhullError, ValueError):
        # Fewer than three points, or points in line.
        return np.arange(len(points))


def view_corners(rig_camera: RigCamera, seen_points_mm: Floats) -> Floats:
    """Corners (K, 3) of the view: the projection centre and the outermost seen points (N, 3)."""
    flat = perspective(rig_camera.pose.to_camera(seen_points_mm))
    return np.vstack([rig_camera.pose.position_rig_mm, seen_points_mm[_edge(flat)]])


def view_clearance_mm(corners: Floats, body: PlacedBody) -> float:
    """Gap between a view (K, 3) and another camera's body; negative when it stands in the view."""
    return min(signed_distance(corners, part) for part in body.parts)
