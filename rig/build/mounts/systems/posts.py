"""A post square to a plate, and the printed wedge on its side that holds one camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.build.mounts.kinematics import ANGLES, frame, frames_along, head_links, reach
from rig.build.mounts.settings import CameraMount, Link, Motion, Setting, chain_pose, shift
from rig.build.mounts.solids import bar, carried
from rig.build.mounts.structure import Member, Solid, Wedge
from rig.build.mounts.systems.fits import WedgeFit
from rig.catalogue.items import Profile

X, Y, Z = np.eye(3)
LONGEST_POST_MM = 1500.0
FREE_MM = 5.0
"""Plate to the end of a base on its post."""


@dataclass(frozen=True, eq=False)
class Posted:
    """One camera on its post and wedge. ``back_mm``: the post's end to the camera's thread.

    The wedge is made to its figures, so it is that of ``fit`` at all settings.
    """

    mount: CameraMount
    fit: WedgeFit
    back_mm: float
    profile: Profile

    @property
    def post_id(self) -> str:
        """Id of the post."""
        return f"{self.mount.name} post"

    @property
    def wedge_id(self) -> str:
        """Id of the wedge."""
        return self.fit.wedge.id

    @property
    def wedge_along_mm(self) -> float:
        """From the post's foot to the middle of the wedge's base."""
        return self.mount.values()["post"] - self.back_mm + self.fit.footing.middle_mm

    def _frames(self) -> list[Floats]:
        return frames_along(self.mount.chain, self.mount.values())

    def foot(self) -> Floats:
        """The post's foot on the plate (4, 4): x out of its wide side, z along it."""
        return np.asarray(self._frames()[3])

    def base(self) -> Floats:
        """The wedge's base (4, 4)."""
        middle = self.fit.footing.middle_mm * Y - self.fit.seat_mm * Z
        return np.asarray(self._frames()[4] @ shift(middle))

    def member(self) -> Member:
        """The post."""
        foot, length = self.foot(), self.mount.values()["post"]
        axis = np.stack([foot[:3, 3], foot[:3, 3] + length * foot[:3, 2]])
        size = (self.profile.width_mm, self.profile.height_mm)
        return Member(self.post_id, self.profile.id, "post", axis, foot[:3, 0], size)

    def wedge(self) -> Wedge:
        """The wedge in its place."""
        return replace(self.fit.wedge, rig_from_base=self.base())

    def solids(self) -> tuple[Solid, ...]:
        """Post and wedge, the wedge as it is printed."""
        post = self.member()
        return (
            bar(post.id, "member", post.axis_mm[0], post.axis_mm[1], post.across, post.size_mm),
            Solid(self.wedge_id, "wedge", carried(self.base(), self.fit.body_mm)),
        )

    def touching(self) -> tuple[tuple[str, str], ...]:
        """Pairs of owners that touch by intent."""
        return ((self.post_id, self.wedge_id), (self.wedge_id, self.mount.name))


def post_for(camera: RigCamera, fit: WedgeFit, face: Floats, profile: Profile) -> Posted | None:
    """A camera's post on the plate's frame ``face`` (4, 4); None where none is long enough."""
    values = dict(zip(ANGLES, (float(a) for a in fit.angles_deg), strict=True))
    values |= {"across": 0.0, "up": 0.0, "turn": fit.turned_deg, "post": 300.0}
    back = fit.footing.front_mm
    found = reach(_chain(camera, fit, face, back, profile), values, ["across", "up", "post"],
                  fit.pose, with_rotation=False)  # fmt: skip
    length = float(np.ceil(found["post"] - 1e-9))
    back += length - found["post"]
    found["post"] = length
    if not back + fit.footing.rear_mm + FREE_MM <= length <= LONGEST_POST_MM:
        return None
    chain = _chain(camera, fit, face, back, profile)
    placed = camera.moved_to(chain_pose(chain, found))
    return Posted(CameraMount(placed, camera.pose, post_settings(found), chain), fit, back, profile)


def _chain(
    camera: RigCamera, fit: WedgeFit, face: Floats, back_mm: float, profile: Profile
) -> tuple[Link, ...]:
    """From the plate to the camera. ``back_mm``: the post's end to the camera's thread."""
    side = np.array([profile.width_mm / 2.0, 0.0, -back_mm])
    # The wedge's base: x across the post, y along it, z out of its side.
    base, thread = frame(side, Y, Z, X), camera.camera.body.mount_thread_camera_mm
    return (
        Link(face, Motion.SLIDE, X, "across"),
        Link(np.eye(4), Motion.SLIDE, Y, "up"),
        Link(np.eye(4), Motion.TURN, Z, "turn"),
        Link(np.eye(4), Motion.SLIDE, Z, "post"),
        *head_links(base, fit.seat_mm, fit.seat_mm, thread),
    )


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
