"""The mount layout: where each body goes, how it is set, and what it comes close to.

The datum is the foremost point of the subject, towards the cameras: the nose tip of a face.
A builder marks it with a pointer or a head form on the stand and measures from it: across
(+X, to the subject's left), back (towards the cameras, -Y) and up (+Z). Every camera also
gets one straight tape length, from the datum to the middle of the lens front, as a check.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats, frozen
from geometry.camera import RigCamera
from geometry.subject import Subject
from rig.solids.bodies import PlacedBody, clearance_table_mm, place_body
from rig.solids.sight import seen_by, view_clearance_mm, view_corners
from solver.limits import Limits

DATUM_NOTE = (
    "The datum is the foremost point of the subject towards the cameras (the nose tip of a "
    "face). Across is positive to the subject's left, back is positive away from the subject, "
    "up is positive upwards."
)

ROUNDING_MM = 0.05
"""A gap this much short of what was asked is no collision: round lenses are modelled a little
too large, and a design may hold its limits exactly."""


@dataclass(frozen=True, eq=False)
class Neighbour:
    """The camera that comes closest, and the gap to it (negative: they overlap)."""

    name: str
    clearance_mm: float


@dataclass(frozen=True, eq=False)
class Placement:
    """One camera in its place; all points (3,) in the rig frame, millimetres.

    ``body_corners_mm`` (8, 3). ``lens_front_mm`` is the middle of the lens's front (of the
    body's front when there is no lens). ``mount_mm`` is the mouth of the 1/4-20 thread and
    ``mount_axis`` the unit vector along it, out of the body. ``pan_tilt_roll_deg`` (3,) as set
    on a head, see :func:`geometry.frames.pan_tilt_roll_from_rotation`. ``from_datum_mm`` (3,)
    holds across, back and up of the mount; ``tape_mm`` the datum's distance to the lens front.
    ``nearest_body`` is None for a single camera, ``nearest_to_view`` also when it sees nothing.
    """

    camera: RigCamera
    body_corners_mm: Floats
    lens_front_mm: Floats
    mount_mm: Floats
    mount_axis: Floats
    pan_tilt_roll_deg: Floats
    from_datum_mm: Floats
    tape_mm: float
    nearest_body: Neighbour | None
    nearest_to_view: Neighbour | None


@dataclass(frozen=True)
class Collision:
    """Two cameras that come too close.

    ``kind``: ``body``, or ``view`` when ``other`` stands in the view of ``name``.
    ``required_mm`` is the gap that was asked for.
    """

    kind: str
    name: str
    other: str
    clearance_mm: float
    required_mm: float


@dataclass(frozen=True, eq=False)
class Layout:
    """The mount layout of a rig.

    ``envelope_low_mm`` and ``envelope_high_mm`` (3,) are the corners of the smallest box along
    the rig's axes that holds all bodies and lenses. ``clearance_mm`` (n, n) is the table of gaps
    between bodies, infinite on the diagonal.
    """

    datum_rig_mm: Floats
    placements: tuple[Placement, ...]
    envelope_low_mm: Floats
    envelope_high_mm: Floats
    clearance_mm: Floats
    collisions: tuple[Collision, ...]

    @property
    def envelope_size_mm(self) -> Floats:
        """Width (X), depth (Y) and height (Z) of the array, (3,)."""
        return np.asarray(self.envelope_high_mm - self.envelope_low_mm)


def make_layout(cameras: tuple[RigCamera, ...], subject: Subject, limits: Limits) -> Layout:
    """The mount layout of ``cameras`` about ``subject``, checked for collisions."""
    datum = subject.foremost_mm
    bodies = tuple(place_body(camera) for camera in cameras)
    gaps = clearance_table_mm(bodies)
    views = _view_table_mm(cameras, bodies, subject, limits)
    placements = tuple(
        _placement(camera, datum, _nearest(cameras, gaps[i]), _nearest(cameras, views[i]))
        for i, camera in enumerate(cameras)
    )
    corners = np.concatenate([part for body in bodies for part in body.parts])
    return Layout(
        datum_rig_mm=frozen(datum),
        placements=placements,
        envelope_low_mm=frozen(corners.min(axis=0)),
        envelope_high_mm=frozen(corners.max(axis=0)),
        clearance_mm=frozen(gaps),
        collisions=_collisions(cameras, gaps, views, limits),
    )


def _view_table_mm(
    cameras: tuple[RigCamera, ...], bodies: tuple[PlacedBody, ...], subject: Subject, limits: Limits
) -> Floats:
    """Gap (n, n) of body j to the view of camera i; infinite where there is nothing to say."""
    table = np.full((len(cameras), len(cameras)), np.inf)
    points = subject.check_points
    for i, camera in enumerate(cameras):
        seen = seen_by(camera, points, subject.occluder, limits.incidence.ray_max_deg)
        if not seen.any():
            continue
        corners = view_corners(camera, points.points_mm[seen])
        for j, body in enumerate(bodies):
            if i != j:
                table[i, j] = view_clearance_mm(corners, body)
    return table


def _nearest(cameras: tuple[RigCamera, ...], gaps_mm: Floats) -> Neighbour | None:
    index = int(np.argmin(gaps_mm))
    gap = float(gaps_mm[index])
    return Neighbour(cameras[index].name, gap) if np.isfinite(gap) else None


def _placement(
    camera: RigCamera, datum: Floats, body: Neighbour | None, view: Neighbour | None
) -> Placement:
    solid, pose = camera.camera.body, camera.pose
    box = place_body(camera).parts[0]
    points = np.array(
        [[0.0, 0.0, solid.front_z_mm + solid.lens_length_mm], solid.mount_thread_camera_mm]
    )
    front, mount = pose.to_rig(points)
    across, towards, up = mount - datum
    return Placement(
        camera=camera,
        body_corners_mm=frozen(box),
        lens_front_mm=frozen(front),
        mount_mm=frozen(mount),
        mount_axis=frozen(pose.rotation_rig_to_camera[1]),
        pan_tilt_roll_deg=frozen(pose.pan_tilt_roll_deg),
        from_datum_mm=frozen([across, -towards, up]),
        tape_mm=float(np.linalg.norm(front - datum)),
        nearest_body=body,
        nearest_to_view=view,
    )


def _collisions(
    cameras: tuple[RigCamera, ...], gaps: Floats, views: Floats, limits: Limits
) -> tuple[Collision, ...]:
    """Everything that comes closer than asked; overlaps are listed whatever was asked."""
    body_mm, view_mm = limits.body_clearance_mm or 0.0, limits.sight_line_clearance_mm or 0.0
    found = []
    for i, one in enumerate(cameras):
        for j, other in enumerate(cameras):
            if j > i and gaps[i, j] < body_mm - ROUNDING_MM:
                found.append(Collision("body", one.name, other.name, float(gaps[i, j]), body_mm))
            if views[i, j] < view_mm - ROUNDING_MM:
                found.append(Collision("view", one.name, other.name, float(views[i, j]), view_mm))
    return tuple(found)
