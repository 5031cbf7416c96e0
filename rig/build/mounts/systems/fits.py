"""How a camera can sit on a printed wedge on the side of a post that is square to a plate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.build.mounts.kinematics import PLATE_FROM_CAMERA, head_angles, rotated, turned_over
from rig.build.mounts.settings import turn
from rig.build.mounts.solids import camera_solids, carried
from rig.build.mounts.structure import Hole, Wedge
from rig.build.mounts.systems.footing import BaseFooting, clear_footing
from rig.build.wedges import print_part
from rig.build.wedges.fastenings import room_for
from rig.build.wedges.shape import SEAT_MM
from rig.catalogue import Catalogue
from rig.catalogue.items import Profile
from rig.solids.convex import box_corners, cylinder_corners

_, Y, Z = np.eye(3)
LEAST_SEAT_MM = 12.0
UNDER_MM = 3.0
STEEPEST = float(np.cos(np.radians(65.0)))
"""Steepest seat, 65 degrees: beyond it a printed wedge leans too far to be strong."""

TURNS_DEG = (0.0, 30.0, -30.0, 60.0, -60.0)
LEVEL = 0.2
"""Least share of the camera's upright that must lie along the plate: no side of a post is under
a camera that stands on its back."""

NEARER_DEG = 5.0
SCREW_HOLES_MM = {"M5": 5.5, "M6": 6.6, "M8": 9.0, "5/16-18": 8.4}
"""Clearance holes of the medium series, ISO 273; for inches ASME B18.2.8 normal fit."""

CAMERA_SCREW = "stud-1-4-20"
CAMERA_HOLE_MM = 6.8


@dataclass(frozen=True, eq=False)
class WedgeFit:
    """A wedge that can be printed, wherever its post stands.

    ``pose``: the camera's, or turned over; ``turned_deg``: how the post is turned on the plate;
    ``angles_deg`` (3,): pan, tilt, roll on the wedge's base; ``seat_mm``: the seat over the base.
    ``wedge`` lies at the rig's origin; ``body_mm`` (K, 3) are the corners of the convex body it
    is cut from, in the frame of its base.
    """

    pose: Pose
    turned_deg: float
    angles_deg: Floats
    seat_mm: float
    footing: BaseFooting
    wedge: Wedge
    body_mm: Floats


@dataclass(frozen=True, eq=False)
class Fitter:
    """Finds wedges on posts of ``profile``; ``axes`` (3, 3) are the plate's, as columns."""

    axes: Floats
    profile: Profile
    catalogue: Catalogue

    def fits(self, camera: RigCamera) -> Iterator[WedgeFit]:
        """The ways to hold a camera, the straightest first; at least one.

        :class:`InputError` where there is none, with the nearest direction that can be held.
        """
        refused: InputError | None = None
        count = 0
        for tried in self._tries(camera):
            if isinstance(tried, WedgeFit):
                count += 1
                yield tried
            else:
                refused = refused or tried
        if count == 0:
            if refused is not None and refused.detail == "wedge-name":
                raise refused
            raise self._too_steep(camera, refused)

    def _tries(self, camera: RigCamera) -> Iterator[WedgeFit | InputError]:
        """Every turn of the post: the wedge, or why it cannot be printed.

        Screws behind the camera come first: its lens leaves more room there, and the post is
        shorter. Where the camera looks up from its post, the plane of the seat cuts off what is
        behind, and only screws ahead of it hold.
        """
        for more, ahead in product(TURNS_DEG, (False, True)):
            for pose in (camera.pose, turned_over(camera.pose)):
                up = -pose.rotation_rig_to_camera[1] @ self.axes[:, :2]
                if float(np.hypot(*up)) < LEVEL:
                    continue
                turned = float(np.degrees(np.arctan2(up[1], up[0]))) + more
                foot = self.axes @ turn(Z, turned)
                base = np.stack([foot[:, 1], foot[:, 2], foot[:, 0]], axis=1)
                if -pose.rotation_rig_to_camera[1] @ base[:, 2] < STEEPEST:
                    continue
                try:
                    yield self._fit(camera, pose, turned, base, ahead)
                except InputError as error:
                    yield error

    def _fit(
        self, camera: RigCamera, pose: Pose, turned_deg: float, base: Floats, ahead: bool
    ) -> WedgeFit:
        """The wedge on a post turned so far; ``base`` (3, 3) are the axes of its side."""
        profile, seat = self.profile, seat_height(camera, pose, base)
        axes = base.T @ pose.rotation_rig_to_camera.T @ PLATE_FROM_CAMERA.T
        rooms = (
            room_for(CAMERA_SCREW, self.catalogue), room_for(profile.bolt or "M5", self.catalogue)
        )  # fmt: skip
        blocks = _over_base(camera, rotated(axes, seat * Z))
        footing = clear_footing(
            blocks, seat, axes[:, 2], rooms, profile.height_mm / 4.0, ahead=ahead
        )
        stands = rotated(axes, seat * Z - footing.middle_mm * Y)
        wedge = _wedge(camera, rotated(base), stands, footing, profile)
        part = print_part(wedge, self.catalogue)
        body = carried(np.linalg.inv(wedge.rig_from_base) @ part.rig_from_print, part.corners_mm)
        angles = head_angles(pose.rotation_rig_to_camera, base)
        return WedgeFit(pose, turned_deg, angles, seat, footing, wedge, body)

    def _too_steep(self, camera: RigCamera, refused: InputError | None) -> InputError:
        """Why no wedge holds a camera, and how far it would have to be turned for one."""
        normal = self.axes[:, 2]
        away = float(np.degrees(np.arccos(np.clip(camera.pose.axis_rig @ normal, -1.0, 1.0))))
        why = f"no wedge on a plate can hold {camera.name}: it looks {away:.0f} degrees off the "
        why += "plate's normal" + (f" ({refused.problem})" if refused is not None else "")
        other = "choose a frame or an arc for it"
        for less in np.arange(NEARER_DEG, away, NEARER_DEG):
            nearer = camera.moved_to(_turned_in(camera.pose, normal, float(less)))
            if any(isinstance(tried, WedgeFit) for tried in self._tries(nearer)):
                other = f"turn it {less:.0f} degrees towards the plate's normal, or {other}"
                break
        return InputError("wedge-steep", why, other)


def _turned_in(pose: Pose, normal: Floats, angle_deg: float) -> Pose:
    """The pose turned towards looking along ``normal``."""
    hinge = np.cross(pose.axis_rig, normal)
    if float(np.linalg.norm(hinge)) < 1e-9:
        # It looks straight at the plate: any way round is as near.
        hinge = pose.rotation_rig_to_camera[1]
    turned = turn(hinge / np.linalg.norm(hinge), angle_deg) @ pose.rotation_rig_to_camera.T
    return Pose(pose.position_rig_mm, turned.T)


def _over_base(camera: RigCamera, base_from_seat: Floats) -> list[Floats]:
    """Body, lens and the slab of the seat, each as corners (N, 3) in the frame of the base."""
    body = camera.camera.body
    thread = body.mount_thread_camera_mm
    solids = [box_corners(body.size_mm, body.centre_camera_mm)]
    if body.lens_diameter_mm > 0.0 and body.lens_length_mm > 0.0:
        front = body.front_z_mm
        solids.append(cylinder_corners(body.lens_diameter_mm, front, front + body.lens_length_mm))
    out = [carried(base_from_seat, (s - thread) @ PLATE_FROM_CAMERA.T) for s in solids]
    slab = box_corners(np.array([*seat_size(camera), SEAT_MM]), -SEAT_MM / 2.0 * Z)
    return [*out, carried(base_from_seat, slab)]


def _wedge(
    camera: RigCamera,
    rig_from_base: Floats,
    base_from_seat: Floats,
    footing: BaseFooting,
    profile: Profile,
) -> Wedge:
    """The wedge; its base holes lie over the post's two slots."""
    # In the base's frame x runs across the post, y along it.
    places = [
        (sign * footing.slot_mm, row - footing.middle_mm)
        for sign in (-1, 1)
        for row in footing.rows_mm
    ]
    hole = SCREW_HOLES_MM.get(profile.bolt or "", 5.5)
    holes = tuple(
        Hole(f"{camera.name} {k}", x, y, hole, "through", profile.bolt or "")
        for k, (x, y) in enumerate(places, 1)
    )
    return Wedge(
        f"{camera.name} wedge", camera.name, rig_from_base, base_from_seat, seat_size(camera),
        (profile.height_mm, footing.length_mm), holes, CAMERA_SCREW, CAMERA_HOLE_MM,
    )  # fmt: skip


def seat_size(camera: RigCamera) -> tuple[float, float]:
    """Width and depth of the seat: the camera's underside, 40 by 30 mm at most."""
    width, _, depth = camera.camera.body.size_mm
    return min(float(width), 40.0), min(float(depth), 30.0)


def seat_height(camera: RigCamera, pose: Pose, base: Floats) -> float:
    """How high the seat must be for body, lens and plug to clear the post's side."""
    placed = camera.moved_to(pose)
    mouth = pose.to_rig(camera.camera.body.mount_thread_camera_mm[None])[0]
    corners = np.concatenate([solid.corners_mm for solid in camera_solids(placed)])
    height = (corners - mouth) @ base[:, 2]
    return max(LEAST_SEAT_MM, UNDER_MM - float(height.min()))
