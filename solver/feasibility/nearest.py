"""How near a camera may stand to what it sees, wherever it aims."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Bools, Floats
from geometry.camera import Camera
from geometry.frames import look_at_rotation

_AIMS = 9
"""Aims across the frame, each way: half the angle between two of them changes the depth of what is
seen by so little that :data:`BETWEEN_AIMS` makes up for it."""

BETWEEN_AIMS = 0.95
"""With aims 3.8 degrees apart one is within 2.7; a face 170 mm across is then 8 mm deeper, of some
100 mm, and the distance grows with the root of the depth: 4 %."""

_HALVINGS = 30


def aims(camera: Camera, seen_mm: Floats, eye_mm: Floats) -> Floats:
    """Axes (a, 3) with which a camera at ``eye_mm`` (3,) has the middle of ``seen_mm`` in frame.

    The roll is left open: the frame is taken for a circle through its corners.
    """
    across = camera.frame_limits(0.0)
    corner = float(np.hypot(np.abs(across[:2]).max(), np.abs(across[2:]).max()))
    grid = np.linspace(-corner, corner, _AIMS)
    x, y = (g.ravel() for g in np.meshgrid(grid, grid))
    within = np.hypot(x, y) <= corner * (1.0 + 1e-9)
    axes = np.stack([x, y, np.ones_like(x)], axis=1)[within]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return np.asarray(axes @ look_at_rotation(eye_mm, seen_mm.mean(axis=0)))


def depths(seen_mm: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Least and greatest depth (a,) of points (p, 3) along each of the ``axes`` (a, 3)."""
    along = seen_mm @ axes.T
    return along.min(axis=0), along.max(axis=0)


def sharp_from_mm(camera: Camera, low_mm: Floats, high_mm: Floats) -> Floats:
    """Least depth (k,) of a middle about which ``low_mm`` to ``high_mm`` (k,) can be sharp.

    Those are depths relative to that middle. For a camera whose focus can be set; the harmonic mean
    of both depths suits it best, as for the starts.
    """
    near = 1.0 - low_mm
    far = near + 200.0 * (high_mm - low_mm) + 100.0 * camera.min_focus_distance_mm
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        sharp = _sharp(camera, middle + low_mm, middle + high_mm)
        near, far = np.where(sharp, near, middle), np.where(sharp, middle, far)
    return np.asarray(far)


def _sharp(camera: Camera, near_mm: Floats, far_mm: Floats) -> Bools:
    focus = np.maximum(2.0 * near_mm * far_mm / (near_mm + far_mm), camera.min_focus_distance_mm)
    reach = focus - camera.focal_length_mm
    k = camera.circle_of_confusion_mm * camera.f_number * reach / camera.focal_length_mm**2
    return np.asarray((focus - near_mm <= k * near_mm) & (far_mm - focus <= k * far_mm))
