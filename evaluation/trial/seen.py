"""Which places of a surface a rig can measure at all: those that two cameras see."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry.arrays import Bools, Floats
from geometry.camera import RigCamera
from geometry.raycast import Occluder

STEEPEST_DEG = 70.0
"""Seen at more than that from the normal, a patch is three times narrower than high."""


def seen_by(places_mm: Floats, normals: Floats, camera: RigCamera, occluder: Occluder) -> Bools:
    """Whether a camera sees each place (N, 3), (N,): within its image, not hidden, not slanted.

    Slanted is by more than 70 degrees against its ray. ``normals`` (N, 3) are unit vectors.
    """
    eye = camera.pose.position_rig_mm
    ray = eye - places_mm
    ray = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    facing = np.einsum("ni,ni->n", ray, normals) >= np.cos(np.radians(STEEPEST_DEG))
    pixel, depth = camera.camera.project(camera.pose, places_mm)
    width, height = camera.camera.image_size_px
    with np.errstate(invalid="ignore"):
        inside = (depth > 0.0) & (pixel >= 0.0).all(axis=1)
        inside &= (pixel[:, 0] <= width - 1) & (pixel[:, 1] <= height - 1)
    seen = np.asarray(facing & inside)
    tried = np.flatnonzero(seen)
    seen[tried] = ~occluder.hidden(places_mm[tried], normals[tried], eye)
    return seen


def seen_by_two(
    places_mm: Floats, normals: Floats, cameras: Sequence[RigCamera], occluder: Occluder
) -> Bools:
    """Whether at least two cameras see each place (N, 3), (N,)."""
    count = np.zeros(len(places_mm), dtype=np.int64)
    for camera in cameras:
        count += seen_by(places_mm, normals, camera, occluder)
    return np.asarray(count >= 2)
