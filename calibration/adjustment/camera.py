"""A calibrated camera: interior and exterior orientation, as the adjustment knows them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, frozen
from geometry.camera import (
    INTERIOR_NAMES,
    NO_DISTORTION,
    STRETCH,
    TERM_COUNTS,
    LensModel,
    RigCamera,
    distort,
    interior_vector,
    lens_terms,
    model_of,
    own_terms,
    perspective,
    undistort,
)
from geometry.frames import Pose

POSE_NAMES = ("x", "y", "z", "rx", "ry", "rz")
"""Exterior parameters: projection centre, mm, and turn about the camera's axes, radians."""

INTERIOR = len(INTERIOR_NAMES)
PER_CAMERA = INTERIOR + len(POSE_NAMES)


@dataclass(frozen=True, eq=False)
class Interior:
    """Interior orientation. Pixel centres at integers.

    ``x_px = f (1 + b1) x + cx``, ``y_px = f y + cy`` of normalised coordinates distorted after
    Brown-Conrady with ``distortion`` (5,) k1, k2, p1, p2, k3, or as a rational (8,) or fisheye
    lens (4,) after :mod:`geometry.camera.distortion`. ``affinity`` b1 is how much wider than tall
    the pixels image; square pixels have 0.
    """

    focal_length_px: float
    principal_point_px: Floats
    distortion: Floats = field(default_factory=lambda: NO_DISTORTION)
    affinity: float = 0.0

    def __post_init__(self) -> None:
        centre, terms = frozen(self.principal_point_px), frozen(self.distortion)
        values = (self.focal_length_px, self.affinity, *centre.ravel(), *terms.ravel())
        if not np.isfinite(values).all() or self.focal_length_px <= 0.0:
            raise InputError(
                "interior",
                "an interior orientation has a value that cannot be",
                "give a positive focal_length_px and finite values",
            )
        if centre.shape != (2,) or terms.ndim != 1 or len(terms) not in TERM_COUNTS:
            raise InputError(
                "interior",
                "an interior orientation has the wrong number of values",
                "give principal_point_px [x, y] and distortion [k1, k2, p1, p2, k3], with k4, "
                "k5, k6 for a rational lens, or [k1, k2, k3, k4] for a fisheye",
            )
        object.__setattr__(self, "principal_point_px", centre)
        object.__setattr__(self, "distortion", terms)

    @property
    def lens_model(self) -> LensModel:
        """By which equations the lens bends."""
        return model_of(self.distortion)

    @property
    def vector(self) -> Floats:
        """The parameters (13,) in the order of :data:`INTERIOR_NAMES`."""
        return interior_vector(
            self.focal_length_px, self.principal_point_px, self.distortion, self.affinity
        )

    @classmethod
    def of(cls, vector: Floats) -> Self:
        """From the parameters (13,) in the order of :data:`INTERIOR_NAMES`."""
        terms = own_terms(lens_terms(vector))
        return cls(float(vector[0]), vector[1:3], terms, float(vector[STRETCH]))

    @property
    def camera_matrix(self) -> Floats:
        """K (3, 3) in OpenCV's convention."""
        (cx, cy), f = self.principal_point_px, self.focal_length_px
        return np.array([[f * (1.0 + self.affinity), 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])

    def normalised(self, pixels: Floats) -> Floats:
        """Undistorted normalised coordinates (n, 2) of pixels (n, 2)."""
        scale = self.focal_length_px * np.array([1.0 + self.affinity, 1.0])
        return undistort((pixels - self.principal_point_px) / scale, self.distortion)

    def pixels(self, normalised: Floats) -> Floats:
        """Pixels (n, 2) of normalised coordinates (n, 2)."""
        scale = self.focal_length_px * np.array([1.0 + self.affinity, 1.0])
        return distort(normalised, self.distortion) * scale + self.principal_point_px


@dataclass(frozen=True, eq=False)
class CalibratedCamera:
    """A camera with both its orientations and the size of its images, width and height."""

    name: str
    image_size_px: tuple[int, int]
    interior: Interior
    pose: Pose

    @classmethod
    def from_rig(cls, camera: RigCamera) -> Self:
        """A designed camera as a start of its calibration."""
        kind = camera.camera
        interior = Interior(kind.focal_length_px, kind.principal_point_px, kind.distortion)
        return cls(camera.name, kind.image_size_px, interior, camera.pose)

    def project(self, points_rig_mm: Floats) -> Floats:
        """Pixels (n, 2) of points (n, 3); NaN behind the camera."""
        return self.interior.pixels(perspective(self.pose.to_camera(points_rig_mm)))

    def rays(self, pixels: Floats) -> Floats:
        """Unit directions (n, 3) in the rig frame of pixels (n, 2)."""
        directions = np.ones((len(pixels), 3))
        directions[:, :2] = self.interior.normalised(pixels)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return np.asarray(directions @ self.pose.rotation_rig_to_camera)
