"""Start values that OpenCV has methods for. The one module of the adjustment that calls it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.adjustment.camera import Interior
from calibration.adjustment.initialisation.views import is_planar
from calibration.adjustment.rotations import rotation_of
from geometry.arrays import Bools, Floats
from geometry.camera import perspective

MAX_VIEWS = 15
"""Plates beyond this many add nothing to a start but time."""


@dataclass(frozen=True, eq=False)
class RigidTransform:
    """A carrier in a camera's frame, ``x_camera = rotation x + translation_mm``."""

    rotation: Floats
    translation_mm: Floats

    def image(self, points_mm: Floats) -> Floats:
        """Normalised coordinates (n, 2) of points (n, 3); NaN behind the camera."""
        return perspective(points_mm @ self.rotation.T + self.translation_mm)


def _cv2() -> Any:  # noqa: ANN401 - OpenCV has no types worth the name
    # Imported late: the library takes a third of a second, and reading a file needs none of it.
    import cv2

    return cv2


def placed_candidates(points_mm: Floats, normalised: Floats) -> list[RigidTransform]:
    """Where a carrier may stand in a camera's frame: one answer, or two for a plane.

    ``points_mm`` (n, 3) with n >= 4, ``normalised`` (n, 2) undistorted. Seen through a long lens
    a plane and its mirror image in depth look nearly alike; other views must choose.
    """
    cv2 = _cv2()
    centre, axes = points_mm.mean(axis=0), np.eye(3)
    points = points_mm - centre
    method = cv2.SOLVEPNP_SQPNP
    if is_planar(points):
        method = cv2.SOLVEPNP_IPPE
        # It answers nothing when a plane is not exactly flat, as a measured plate never is.
        points, axes = _in_plane(points)
    points = np.ascontiguousarray(points)
    try:
        _, rotations, translations, _ = cv2.solvePnPGeneric(
            points, np.ascontiguousarray(normalised), np.eye(3), None, flags=method
        )
    except cv2.error:
        return []  # OpenCV's way to say that the points are degenerate
    found = []
    for turn, translation in zip(rotations, translations, strict=True):
        rotation = rotation_of(np.asarray(turn, np.float64).reshape(3)) @ axes
        moved = np.asarray(translation, np.float64).reshape(3) - rotation @ centre
        if np.isfinite(rotation).all() and np.isfinite(moved).all():
            found.append(RigidTransform(rotation, moved))
    return found


def interior_from_planes(
    views: list[tuple[Floats, Floats]], size_px: tuple[int, int], rational: bool = False
) -> Interior | None:
    """Interior from views of plates, (points (n, 3), pixels (n, 2)) each (Zhang's method).

    Of Brown's terms as many as it takes; ``rational`` ones where those do not suffice.
    """
    cv2 = _cv2()
    views = sorted(views, key=lambda v: -len(v[0]))[:MAX_VIEWS]
    flat = [_in_plane(points)[0] for points, _ in views]
    objects = [np.ascontiguousarray(p, np.float32) for p in flat]
    images = [np.ascontiguousarray(p, np.float32).reshape(-1, 1, 2) for _, p in views]
    held = cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_ASPECT_RATIO
    held |= cv2.CALIB_USE_INTRINSIC_GUESS
    higher = [cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3, cv2.CALIB_FIX_K3, 0]
    if len(views) < 4:
        held |= cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_FIX_K1
        higher = higher[:1]
    elif rational:
        higher.append(cv2.CALIB_RATIONAL_MODEL)
    found = None
    for terms in higher:
        try:
            guess = cv2.initCameraMatrix2D(objects, images, size_px, 1.0)
            _, matrix, told, _, _ = cv2.calibrateCamera(
                objects, images, size_px, guess, np.zeros(8), flags=held | terms
            )
        except cv2.error:
            return found  # the views do not determine a camera
        count = 8 if terms & cv2.CALIB_RATIONAL_MODEL else 5
        found = _start_of(matrix, np.ravel(told)[:count], size_px) or found
        # A few terms of a wide lens fold back within the picture: more of them may not.
        if found is not None and _sees_all(found, views):
            break
    return found


def _start_of(matrix: Floats, terms: Floats, size_px: tuple[int, int]) -> Interior | None:
    f = float(matrix[0, 0])
    if not np.isfinite([f, *terms]).all() or not 0.2 < f / max(size_px) < 50.0:
        return None
    return Interior(f, np.array([matrix[0, 2], matrix[1, 2]]), terms)


def _sees_all(interior: Interior, views: list[tuple[Floats, Floats]]) -> bool:
    """Whether every pixel with a target has a ray."""
    return all(np.isfinite(interior.normalised(pixels)).all() for _, pixels in views)


def _in_plane(points: Floats) -> tuple[Floats, Floats]:
    """Points of a plane (n, 3) in axes (3, 3) of their own with z = 0, right-handed as before."""
    centred = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    axes = axes * np.array([[1.0], [1.0], [np.linalg.det(axes)]])
    flat = centred @ axes.T
    flat[:, 2] = 0.0
    return flat, np.asarray(axes)


def relative_pose(
    first: Floats, second: Floats, tolerance: float
) -> tuple[RigidTransform, Bools] | None:
    """The second camera's frame from the first's, with a base of length 1, and the inliers (n,).

    ``first``, ``second`` (n, 2) are normalised coordinates of the same points, ``tolerance`` in
    the same unit (essential matrix by RANSAC).
    """
    cv2 = _cv2()
    a, b = np.ascontiguousarray(first), np.ascontiguousarray(second)
    try:
        essential, mask = cv2.findEssentialMat(
            a, b, np.eye(3), method=cv2.RANSAC, prob=0.9999, threshold=tolerance
        )
        if essential is None or essential.shape != (3, 3):
            return None
        count, rotation, translation, mask = cv2.recoverPose(essential, a, b, np.eye(3), mask=mask)
    except cv2.error:
        return None  # too few points, or degenerate ones
    if count < 6:
        return None
    pose = RigidTransform(np.asarray(rotation), np.asarray(translation).reshape(3))
    return pose, np.asarray(np.ravel(mask) > 0)
