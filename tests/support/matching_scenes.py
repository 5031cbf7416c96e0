"""Cameras before a textured plane whose pictures can be computed exactly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evaluation.reconstruction.views import View
from geometry.arrays import Floats
from geometry.frames import Pose

FOCAL_PX = 900.0
SIZE_PX = (240, 180)
TILTED = np.array([0.25, -0.95, 0.15])
"""Normal of the plane through the origin; cameras stand at negative Y."""


def looking_at_origin(position_mm: Sequence[float], roll_deg: float = 0.0) -> Pose:
    """A camera at a place that looks at the origin, rolled about its axis."""
    place = np.asarray(position_mm, dtype=np.float64)
    z = -place / np.linalg.norm(place)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    c, s = np.cos(np.radians(roll_deg)), np.sin(np.radians(roll_deg))
    return Pose(place, np.array([c * x + s * y, c * y - s * x, z]))


def texture(points_mm: Floats) -> Floats:
    """Grey values of the surface, smooth enough to sample at 0.5 mm a pixel."""
    x, y, z = points_mm.T
    waves = (
        np.sin(1.1 * x + 0.3 * z)
        + np.sin(0.7 * x - 1.3 * z + 1.0)
        + np.sin(0.45 * x + 0.9 * z + 2.0)
        + np.sin(1.7 * z - 0.2 * y)
    )
    return np.asarray(0.5 + 0.09 * waves)


def plane_view(name: str, pose: Pose, normal: Floats = TILTED, noise: float = 0.0) -> View:
    """The picture of the plane through the origin, exact to the last bit of a float."""
    w, h = SIZE_PX
    matrix = np.array([[FOCAL_PX, 0.0, (w - 1) / 2], [0.0, FOCAL_PX, (h - 1) / 2], [0, 0, 1.0]])
    u, v = np.meshgrid(np.arange(w), np.arange(h))
    rays = np.stack([u.ravel(), v.ravel(), np.ones(w * h)], axis=1) @ np.linalg.inv(matrix).T
    directions = rays @ pose.rotation_rig_to_camera
    reach = -(pose.position_rig_mm @ normal) / (directions @ normal)
    grey = texture(pose.position_rig_mm + reach[:, None] * directions).reshape(h, w)
    grey += noise * np.random.default_rng(len(name)).normal(size=grey.shape)
    colour = np.repeat((255 * grey.clip(0, 1)).astype(np.uint8)[..., None], 3, axis=2)
    clipped = np.zeros((h, w), dtype=bool)
    return View(name, grey.astype(np.float32), colour, matrix, pose, clipped)


def true_inverse_depth(view: View, normal: Floats = TILTED) -> Floats:
    """Inverse depth of the plane at every pixel of a view, (H, W), 1/mm."""
    w, h = view.size_px
    u, v = np.meshgrid(np.arange(w), np.arange(h))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(view.matrix).T
    directions = rays @ view.pose.rotation_rig_to_camera
    return np.asarray(-(directions @ normal) / (view.pose.position_rig_mm @ normal))


def plane_views(noise: float = 0.0) -> list[View]:
    """Four cameras about the plane, two of them rolled."""
    places = [(0, -420, 0), (110, -400, 20), (-115, -405, -15), (10, -400, 118)]
    rolls = [0.0, 20.0, -75.0, 0.0]
    return [
        plane_view(f"cam{k}", looking_at_origin(p, r), noise=noise)
        for k, (p, r) in enumerate(zip(places, rolls, strict=True), 1)
    ]
