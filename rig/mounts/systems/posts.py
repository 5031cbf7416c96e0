"""A post square to a plate, and the printed wedge on its side that holds one camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.frames import Pose
from rig.catalogue.items import Profile
from rig.convex import box_corners
from rig.mounts.kinematics import frames_along
from rig.mounts.settings import CameraMount, Setting, shift
from rig.mounts.solids import bar, carried
from rig.mounts.structure import Hole, Member, Solid, Wedge

X, Y, Z = np.eye(3)
BASE_LENGTH_MM = 60.0
HOLE_SPREAD_MM = 15.0
LEAST_SEAT_MM = 12.0
UNDER_MM = 3.0
LONGEST_POST_MM = 1500.0
SCREW_HOLES_MM = {"M5": 5.5, "M6": 6.6, "M8": 9.0, "5/16-18": 8.4}
"""Clearance holes of the medium series, ISO 273; for inches ASME B18.2.8 normal fit."""

CAMERA_SCREW = "stud-1-4-20"
CAMERA_HOLE_MM = 6.8


@dataclass(frozen=True, eq=False)
class Posted:
    """One camera on its post and wedge. ``wedge_back_mm``: the post's end to the wedge's middle."""

    mount: CameraMount
    seat_mm: float
    wedge_back_mm: float
    profile: Profile

    @property
    def post_id(self) -> str:
        """Id of the post."""
        return f"{self.mount.name} post"

    @property
    def wedge_id(self) -> str:
        """Id of the wedge."""
        return f"{self.mount.name} wedge"

    def _frames(self) -> list[Floats]:
        return frames_along(self.mount.chain, self.mount.values())

    def foot(self) -> Floats:
        """The post's foot on the plate (4, 4): x out of its wide side, z along it."""
        return np.asarray(self._frames()[3])

    def base(self) -> Floats:
        """The wedge's base (4, 4)."""
        return np.asarray(self._frames()[4] @ shift(-self.seat_mm * Z))

    def seat(self) -> Floats:
        """The seat in the wedge's base, (4, 4)."""
        camera = self._frames()[-1]
        seat = camera @ np.linalg.inv(self.mount.chain[-1].transform)
        return np.asarray(np.linalg.inv(self.base()) @ seat)

    def seat_size(self) -> tuple[float, float]:
        """Width and depth of the seat: the camera's underside, 40 by 30 mm at most."""
        width, _, depth = self.mount.camera.camera.body.size_mm
        return min(float(width), 40.0), min(float(depth), 30.0)

    def member(self) -> Member:
        """The post."""
        foot, length = self.foot(), self.mount.values()["post"]
        axis = np.stack([foot[:3, 3], foot[:3, 3] + length * foot[:3, 2]])
        size = (self.profile.width_mm, self.profile.height_mm)
        return Member(self.post_id, self.profile.id, "post", axis, foot[:3, 0], size)

    def wedge(self, screw: str) -> Wedge:
        """The wedge; its base holes lie over the post's two slots."""
        slot = self.profile.height_mm / 4.0
        hole = SCREW_HOLES_MM.get(self.profile.bolt or "", 5.5)
        # In the base's frame x runs across the post, y along it.
        holes = tuple(
            Hole(f"{self.mount.name} {k}", x, y, hole, "through", self.profile.bolt or "")
            for k, (x, y) in enumerate(
                ((sx * slot, sy * HOLE_SPREAD_MM) for sx in (-1, 1) for sy in (-1, 1)), 1
            )
        )
        return Wedge(
            self.wedge_id, self.mount.name, self.base(), self.seat(), self.seat_size(),
            (self.profile.height_mm, BASE_LENGTH_MM), holes, screw, CAMERA_HOLE_MM,
        )  # fmt: skip

    def solids(self) -> tuple[Solid, ...]:
        """Post and wedge; the wedge is the hull of base and seat."""
        post = self.member()
        base = self.base()
        flat = np.array([self.profile.height_mm, BASE_LENGTH_MM, 0.0])
        seat = np.array([*self.seat_size(), 0.0])
        corners = np.concatenate(
            [
                carried(base, box_corners(flat, np.zeros(3))),
                carried(base @ self.seat(), box_corners(seat, np.zeros(3))),
            ]
        )
        return (
            bar(post.id, "member", post.axis_mm[0], post.axis_mm[1], post.across, post.size_mm),
            Solid(self.wedge_id, "wedge", corners),
        )

    def touching(self) -> tuple[tuple[str, str], ...]:
        """Pairs of owners that touch by intent."""
        return ((self.post_id, self.wedge_id), (self.wedge_id, self.mount.name))


def seat_height(camera: RigCamera, pose: Pose, base: Floats) -> float:
    """How high the seat must be for the camera to clear the post's side."""
    body = camera.camera.body
    corners = box_corners(body.size_mm, body.centre_camera_mm) - body.mount_thread_camera_mm
    height = corners @ pose.rotation_rig_to_camera @ base[:, 2]
    return max(LEAST_SEAT_MM, UNDER_MM - float(height.min()))


def post_settings(values: dict[str, float]) -> tuple[Setting, ...]:
    """All of a post and a wedge is made to the figure."""
    words = {
        "across": (
            "mm",
            3000.0,
            "the datum's mark on the plate, right positive seen from its face",
        ),
        "up": ("mm", 3000.0, "the datum's mark on the plate, up positive"),
        "turn": ("deg", 720.0, "the plate's x axis, anticlockwise seen from its face"),
        "post": ("mm", LONGEST_POST_MM, "the face of the plate, cut to this length"),
        "pan": ("deg", 180.0, "along the post, printed"),
        "tilt": ("deg", 90.0, "along the post, printed"),
        "roll": ("deg", 180.0, "upright on the post's side, printed"),
    }
    return tuple(
        Setting(name, unit, values[name], 0.0, 0.0 if name == "post" else -most, most, where)
        for name, (unit, most, where) in words.items()
    )
