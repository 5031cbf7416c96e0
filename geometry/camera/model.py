"""What a camera is: sensor, lens, interior orientation, body, and its place in a rig."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, frozen
from geometry.camera.distortion import (
    NO_DISTORTION,
    TERM_COUNTS,
    LensModel,
    bends,
    distort,
    fold_radius,
    model_of,
    undistort,
)
from geometry.camera.projection import perspective
from geometry.frames import Pose


def _require(condition: bool, detail: str, problem: str, remedy: str) -> None:
    if not condition:
        raise InputError(detail, problem, remedy)


@dataclass(frozen=True, eq=False)
class Body:
    """The solid a camera occupies, in its own camera frame (x right, y down, z forward).

    ``size_mm`` (3,): width, height and depth of the box. ``centre_camera_mm`` (3,): centre of
    the box as seen from the projection centre (z negative: behind it). The lens is a cylinder
    about the optical axis from the front of the box, ``lens_length_mm`` long.
    ``mount_thread_camera_mm`` (3,): the centre of the 1/4-20 thread's mouth; the thread's axis
    points down (+y) out of the body.
    """

    size_mm: Floats
    centre_camera_mm: Floats
    lens_diameter_mm: float = 0.0
    lens_length_mm: float = 0.0
    mount_thread_camera_mm: Floats = field(default_factory=lambda: np.full(3, np.nan))

    def __post_init__(self) -> None:
        size, centre = frozen(self.size_mm), frozen(self.centre_camera_mm)
        _require(
            size.shape == (3,) and bool(np.isfinite(size).all()) and bool((size > 0).all()),
            "body-size",
            "the camera body's size must be three positive lengths",
            "give size_mm = [width, height, depth]",
        )
        _require(
            centre.shape == (3,) and bool(np.isfinite(centre).all()),
            "body-centre",
            "the camera body's centre must be three finite numbers",
            "give centre_mm = [x, y, z] in the camera frame",
        )
        _require(
            self.lens_diameter_mm >= 0.0 and self.lens_length_mm >= 0.0,
            "lens-size",
            "the lens cannot have a negative size",
            "give lengths of zero or more",
        )
        thread = frozen(self.mount_thread_camera_mm)
        if thread.shape != (3,) or not np.isfinite(thread).all():
            thread = frozen(centre + np.array([0.0, size[1] / 2.0, 0.0]))
        object.__setattr__(self, "size_mm", size)
        object.__setattr__(self, "centre_camera_mm", centre)
        object.__setattr__(self, "mount_thread_camera_mm", thread)

    @property
    def front_z_mm(self) -> float:
        """Depth of the box's front face in the camera frame."""
        return float(self.centre_camera_mm[2] + self.size_mm[2] / 2.0)


@dataclass(frozen=True, eq=False)
class Camera:
    """One kind of camera with its lens, as used at every position of a rig.

    ``image_size_px`` (width, height); ``pixel_pitch_mm`` the distance of square pixels;
    ``principal_point_px`` (2,) with pixel centres at integers; ``distortion`` (5,) Brown-Conrady
    k1, k2, p1, p2, k3, or (8,) or (4,) as in :mod:`geometry.camera.distortion`;
    ``circle_of_confusion_mm`` the largest blur disk that counts as sharp.
    ``focus_distance_mm`` None lets the design choose it per camera.
    Raises :class:`InputError` for impossible values.
    """

    name: str
    image_size_px: tuple[int, int]
    pixel_pitch_mm: float
    focal_length_mm: float
    f_number: float
    circle_of_confusion_mm: float
    min_focus_distance_mm: float
    body: Body
    focus_distance_mm: float | None = None
    principal_point_px: Floats = field(default_factory=lambda: np.full(2, np.nan))
    distortion: Floats = field(default_factory=lambda: NO_DISTORTION)

    def __post_init__(self) -> None:
        for label in ("pixel_pitch_mm", "focal_length_mm", "f_number", "circle_of_confusion_mm"):
            value = getattr(self, label)
            _require(
                bool(np.isfinite(value)) and value > 0.0,
                "camera-value",
                f"{label} of camera {self.name!r} is {value}",
                "give a positive number",
            )
        _require(
            min(self.image_size_px) >= 2,
            "camera-image-size",
            f"camera {self.name!r} has images of {self.image_size_px} pixels",
            "give image_size_px = [width, height]",
        )
        nearest = self.focal_length_mm
        _require(
            self.min_focus_distance_mm > nearest
            and (
                self.focus_distance_mm is None
                or self.focus_distance_mm >= self.min_focus_distance_mm
            ),
            "camera-focus",
            f"camera {self.name!r} is focused nearer than its minimum, or its minimum focus "
            f"distance is not beyond the focal length of {nearest:g} mm",
            "give focal_length_mm < min_focus_distance_mm <= focus_distance_mm",
        )
        centre = np.array(self.principal_point_px, dtype=np.float64)
        if centre.shape != (2,) or not np.isfinite(centre).all():
            centre = (np.array(self.image_size_px, dtype=np.float64) - 1.0) / 2.0
        distortion = frozen(self.distortion)
        _require(
            distortion.ndim == 1
            and len(distortion) in TERM_COUNTS
            and bool(np.isfinite(distortion).all()),
            "camera-distortion",
            f"camera {self.name!r} does not have five, eight or four finite distortion terms",
            "give distortion = [k1, k2, p1, p2, k3], with k4, k5, k6 for a rational lens, or "
            "[k1, k2, k3, k4] for a fisheye",
        )
        object.__setattr__(self, "principal_point_px", frozen(centre))
        object.__setattr__(self, "distortion", distortion)
        object.__setattr__(
            self, "image_size_px", (int(self.image_size_px[0]), int(self.image_size_px[1]))
        )

    @property
    def lens_model(self) -> LensModel:
        """By which equations the lens bends."""
        return model_of(self.distortion)

    @property
    def focal_length_px(self) -> float:
        """Focal length in pixels."""
        return self.focal_length_mm / self.pixel_pitch_mm

    @property
    def camera_matrix(self) -> Floats:
        """OpenCV camera matrix, (3, 3)."""
        f, (cx, cy) = self.focal_length_px, self.principal_point_px
        return np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])

    @property
    def sensor_size_mm(self) -> tuple[float, float]:
        """Width and height of the sensor."""
        return self.image_size_px[0] * self.pixel_pitch_mm, self.image_size_px[
            1
        ] * self.pixel_pitch_mm

    @property
    def field_of_view_deg(self) -> tuple[float, float]:
        """Horizontal and vertical field of view through the principal point, as the lens bends it.

        Where the frame reaches beyond the fold of the distortion the view ends at the fold: at
        most 180 degrees, for what lies behind the camera's plane is not described.
        """
        (w, h), (cx, cy) = self.image_size_px, self.principal_point_px
        ends = np.array([[-0.5, cy], [w - 0.5, cy], [cx, -0.5], [cx, h - 0.5]])
        seen = self.normalised(ends)
        tangent = np.array([-seen[0, 0], seen[1, 0], -seen[2, 1], seen[3, 1]])
        tangent = np.where(np.isfinite(tangent), tangent, self._fold)
        left, right, top, bottom = np.degrees(np.arctan(tangent)).tolist()
        return left + right, top + bottom

    def frame_limits(self, margin_px: float = 0.0) -> Floats:
        """Largest upright rectangle of normalised, undistorted coordinates that is in frame.

        (4,): left, right, top, bottom (x/z and y/z) of the frame less ``margin_px`` on each
        side. With distortion the rectangle is inscribed in the undistorted border, so that a
        point inside it is inside the real image too. The image reaches half a pixel beyond the
        centres of its outermost pixels.
        """
        # Kept, as the fold is: one kind of camera is asked again at every place that is tried.
        known = self._frames.get(margin_px)
        if known is None:
            known = self._frames[margin_px] = frozen(self._frame_less(margin_px))
        return known

    def _frame_less(self, margin_px: float) -> Floats:
        w, h = self.image_size_px
        xs = np.linspace(-0.5 + margin_px, w - 0.5 - margin_px, 65)
        ys = np.linspace(-0.5 + margin_px, h - 0.5 - margin_px, 65)
        _require(
            xs[0] < xs[-1] and ys[0] < ys[-1],
            "frame-margin",
            f"a frame margin of {margin_px:g} px leaves nothing of the image",
            "give a smaller frame margin_px",
        )
        edges = [np.stack([np.full(65, v), ys], axis=1) for v in (xs[0], xs[-1])]
        edges += [np.stack([xs, np.full(65, v)], axis=1) for v in (ys[0], ys[-1])]
        left, right, top, bottom = (self.normalised(edge) for edge in edges)
        _require(
            all(bool(np.isfinite(edge).all()) for edge in (left, right, top, bottom)),
            "camera-distortion-folds",
            f"the distortion of camera {self.name!r} turns back on itself within the image",
            "give the distortion of a calibration that covers the whole image",
        )
        return np.array([left[:, 0].max(), right[:, 0].min(), top[:, 1].max(), bottom[:, 1].min()])

    @cached_property
    def _frames(self) -> dict[float, Floats]:
        return {}

    @cached_property
    def _fold(self) -> float:
        return fold_radius(self.distortion)

    def normalised(self, pixels: Floats) -> Floats:
        """Undistorted x/z, y/z (..., 2) of pixels (..., 2); NaN where nothing is imaged to them."""
        distorted = (np.asarray(pixels) - self.principal_point_px) / self.focal_length_px
        return undistort(distorted, self.distortion)

    def pixels(self, normalised: Floats) -> Floats:
        """Pixels (..., 2) of x/z, y/z (..., 2); NaN beyond the fold of the distortion."""
        if not bends(self.distortion):
            return np.asarray(normalised * self.focal_length_px + self.principal_point_px)
        pixels = (
            distort(normalised, self.distortion) * self.focal_length_px + self.principal_point_px
        )
        beyond = np.hypot(normalised[..., 0], normalised[..., 1]) > self._fold
        return np.where(beyond[..., None], np.nan, pixels)

    def project(self, pose: Pose, points_rig_mm: Floats) -> tuple[Floats, Floats]:
        """Pixels (N, 2) and depths (N,) of points (N, 3).

        Pixels are NaN behind the camera and so far aside that the distortion folds back.
        """
        local = pose.to_camera(points_rig_mm)
        return self.pixels(perspective(local)), local[:, 2]

    def rays(self, pixels: Floats) -> Floats:
        """Unit directions (N, 3) in the camera frame of pixels (N, 2)."""
        directions = np.ones((len(pixels), 3))
        directions[:, :2] = self.normalised(pixels)
        return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


@dataclass(frozen=True, eq=False)
class RigCamera:
    """A camera in its place: name, kind, exterior orientation, focus setting.

    ``fixed`` cameras belong to an existing rig: a design leaves them where they are.
    """

    name: str
    camera: Camera
    pose: Pose
    focus_distance_mm: float
    fixed: bool = False

    def moved_to(self, pose: Pose, focus_distance_mm: float | None = None) -> Self:
        """The same camera elsewhere."""
        focus = self.focus_distance_mm if focus_distance_mm is None else focus_distance_mm
        return type(self)(self.name, self.camera, pose, focus, self.fixed)
