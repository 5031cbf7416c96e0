"""One design problem: who looks at what under which limits, in the solver's units."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.arrays import Bools, Floats
from geometry.camera import Camera, RigCamera
from geometry.frames import PHOTO_TO_CV, Pose
from geometry.subject import Subject
from solver.limits import Limits, Zones
from solver.motion import HeadPosition, framing_positions, visibility_positions
from solver.sphere_cover import sphere_cover
from solver.variables import FOCUS, PER_CAMERA, Unknowns
from solver.zones import in_rig_frame


@dataclass(frozen=True, eq=False)
class Problem:
    """Subject, cameras at their start, and limits.

    ``anchor`` are the poses about which Eq 8 bounds the cameras, where these are not the start.

    Positions are divided by :attr:`length_mm`, the mean stand-off of the start, about
    :attr:`origin_mm`, the centroid of the design points. ``object_points`` is the number of
    leading design points that stand for the object where a limit speaks of its mean; those
    after them were added to be assigned views.
    """

    subject: Subject
    cameras: tuple[RigCamera, ...]
    limits: Limits
    anchor: tuple[Pose, ...] | None = None
    origin: Floats | None = None
    object_points: int | None = None

    @cached_property
    def origin_mm(self) -> Floats:
        """Centroid of the design points (3,), unless ``origin`` gives another one."""
        return self.subject.design_points.centroid_mm if self.origin is None else self.origin

    @cached_property
    def length_mm(self) -> float:
        """The length scale: mean distance of the cameras from the centroid."""
        away = [np.linalg.norm(c.pose.position_rig_mm - self.origin_mm) for c in self.cameras]
        return float(np.mean(away))

    def scaled(self, points_mm: Floats) -> Floats:
        """Positions (n, 3) in the solver's units."""
        return np.asarray((points_mm - self.origin_mm) / self.length_mm)

    @property
    def count(self) -> int:
        """Number of cameras, fixed ones included."""
        return len(self.cameras)

    @cached_property
    def unknowns(self) -> Unknowns:
        """Unknowns about the start; what is fixed or has no say is not free."""
        paper_angles = self.limits.bounds is not None and self.limits.bounds.binds_angles
        own = [PHOTO_TO_CV @ c.pose.rotation_rig_to_camera for c in self.cameras]
        base = np.stack([np.eye(3) if paper_angles else m for m in own])
        free = [
            PER_CAMERA * k + u
            for k, c in enumerate(self.cameras)
            if not c.fixed
            for u in range(PER_CAMERA)
            if u != FOCUS or (self.limits.depth_of_field and c.camera.focus_distance_mm is None)
        ]
        return Unknowns(base, self.origin_mm, self.length_mm, np.array(free, dtype=np.int64))

    def start_values(self) -> Floats:
        """All unknowns (7 n,) at the start."""
        focus = np.array([c.focus_distance_mm for c in self.cameras])
        return self.unknowns.pack(tuple(c.pose for c in self.cameras), focus)

    def anchor_values(self) -> Floats:
        """All unknowns (7 n,) at the poses about which bounds hold."""
        if self.anchor is None:
            return self.start_values()
        return self.unknowns.pack(
            self.anchor, np.array([c.focus_distance_mm for c in self.cameras])
        )

    def placed(self, values: Floats) -> tuple[RigCamera, ...]:
        """The cameras at the given unknowns; fixed ones are returned as they are."""
        poses, focus = self.unknowns.unpack(values)
        return tuple(
            c if c.fixed else c.moved_to(pose, float(s))
            for c, pose, s in zip(self.cameras, poses, focus, strict=True)
        )

    @cached_property
    def zones(self) -> Zones:
        """Where bodies may stand, in the rig frame."""
        return in_rig_frame(self.limits.zones, self.subject)

    @cached_property
    def points(self) -> Floats:
        """Design points in the solver's units, (p, 3)."""
        return self.scaled(self.subject.design_points.points_mm)

    @cached_property
    def prior(self) -> float:
        """Prior information per point in the solver's units."""
        return float((self.length_mm / self.limits.coverage.unseen_sigma_mm) ** 2)

    @cached_property
    def ray_weight(self) -> Floats:
        """(f / sigma)**2 of each camera, (n,)."""
        sigma = self.limits.image_sigma_px
        return np.array([(c.camera.focal_length_px / sigma) ** 2 for c in self.cameras])

    @cached_property
    def visibility_positions(self) -> tuple[HeadPosition, ...]:
        """Head positions in which coverage must hold; the rest position first."""
        return visibility_positions(self.limits.motion, self.origin_mm)

    @cached_property
    def framing_positions(self) -> tuple[HeadPosition, ...]:
        """Head positions in which framing and focus must hold."""
        return framing_positions(self.limits.motion, self.origin_mm)

    @cached_property
    def spheres(self) -> tuple[tuple[Floats, Floats], ...]:
        """Per camera the covering spheres in the solver's units: centres (m, 3), radii (m,)."""
        kinds = {id(c.camera): c.camera for c in self.cameras}
        covers = {k: sphere_cover(camera.body) for k, camera in kinds.items()}
        scale = self.length_mm
        return tuple(
            (covers[id(c.camera)][0] / scale, covers[id(c.camera)][1] / scale) for c in self.cameras
        )

    def hull(self, framed: Bools) -> Floats:
        """Corners (m, 3) in mm of the convex hull of some check points.

        Projections keep convex sets convex, so constraints on these corners hold for all.
        Flat or tiny sets are returned whole.
        """
        return self.subject.check_points.corners_mm(framed)


def camera_at(camera: Camera, name: str, pose: Pose, targets_mm: Floats) -> RigCamera:
    """A camera in its place, focused for ``targets_mm`` (3,) or (n, 3) unless its focus is set.

    The focus is the harmonic mean of the nearest and the farthest depth, where both are equally
    sharp.
    """
    depths = (np.atleast_2d(targets_mm) - pose.position_rig_mm) @ pose.axis_rig
    near, far = float(depths.min()), float(depths.max())
    even = 2.0 * near * far / (near + far) if near > 0.0 else camera.min_focus_distance_mm
    focus = camera.focus_distance_mm or max(camera.min_focus_distance_mm, even)
    return RigCamera(name, camera, pose, float(focus))
