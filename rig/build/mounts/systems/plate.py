"""The flat plate: a post for each camera, square to the plate, and a printed wedge on the post.

The plate stands upright behind the cameras. A post is a length of profile with two core bores
(2040), held by two screws through the plate; the line of the two holes sets how the post is
turned. The wedge sits on the post's side near its end and holds the camera's angles exactly. A
post is cut to whole millimetres and the wedge's holes make up for the rest, so nothing is
rounded.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain
from typing import Self

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.build.mounts.clashes import Site, pairs
from rig.build.mounts.kinematics import rotated
from rig.build.mounts.settings import CameraMount, Tape
from rig.build.mounts.solids import bar, box, camera_solids, carried, lens_front
from rig.build.mounts.structure import Hole, Joint, Member, Plate, Structure
from rig.build.mounts.surroundings import Surroundings
from rig.build.mounts.systems.base import USUAL, Built, Spread
from rig.build.mounts.systems.corners import unplaced, with_corners
from rig.build.mounts.systems.fits import CAMERA_SCREW, SCREW_HOLES_MM, Fitter, WedgeFit
from rig.build.mounts.systems.levelling import Levelling, base_z_mm, levelled
from rig.build.mounts.systems.posts import LONGEST_POST_MM, Posted, X, Y, Z, post_for
from rig.build.mounts.systems.stays import StayParts, Stays, stayed
from rig.build.mounts.tolerancing import MADE_DEG, MADE_MM
from rig.catalogue import Catalogue
from rig.catalogue.items import Bracket, Profile

PLATE_AXES = np.stack([-X, Z, Y], axis=1)
"""Seen from the subject: x to the right, y up, z out of the plate towards the subject."""

BEHIND_MM = 25.0
EDGE_MM = 60.0
SPARE_MM = 20.0
"""Plate to the end of the hindmost base, for other turns of its post."""

ROOM_MM = 1.0
FOOT_MM = 350.0


@dataclass(frozen=True, eq=False)
class PlateSystem:
    """A flat plate on two uprights. ``profile`` makes posts and uprights.

    ``stays``: with a stay behind each upright.
    """

    profile: Profile
    corner: Bracket
    pivot: Bracket
    t_nut: str
    screw: str
    thickness_mm: float
    material: str
    catalogue: Catalogue
    levelling: Levelling | None = None
    stays: bool = False
    spread: Spread = USUAL
    kind: str = "plate"
    head: None = None

    @property
    def steps(self) -> tuple[float, float]:
        """Twice what drilling and printing may be off: room is made for that."""
        return 2.0 * MADE_MM, 2.0 * MADE_DEG

    def hold(self, cameras: tuple[RigCamera, ...], around: Surroundings) -> PlateHolding:
        """See :class:`rig.build.mounts.systems.base.MountSystem`."""
        everyone = (*cameras, *around.standing)
        solids = tuple(s for camera in everyone for s in camera_solids(camera))
        site = Site(solids, everyone, around, ROOM_MM)
        fitter = Fitter(PLATE_AXES, self.profile, self.catalogue)
        searches = [fitter.fits(camera) for camera in cameras]
        firsts = [next(search) for search in searches]
        face = self._face(cameras, firsts, around)
        held = []
        for camera, first, others in zip(cameras, firsts, searches, strict=True):
            best = self._best(camera, chain([first], others), face, site)
            site.add(best.solids())
            held.append(best)
        return PlateHolding(self, tuple(held), face, around)

    def _face(
        self, cameras: tuple[RigCamera, ...], fits: list[WedgeFit], around: Surroundings
    ) -> Floats:
        """The plate's frame (4, 4), its origin straight behind the datum.

        Behind every camera with its cable, and so far that every base lies on its post.
        """
        behind = min(
            float(s.corners_mm[:, 1].min()) for c in cameras for s in camera_solids(c)
        ) - BEHIND_MM  # fmt: skip
        # A camera that is turned over has its thread on the other side.
        threads = [
            fit.pose.to_rig(c.camera.body.mount_thread_camera_mm[None])[0, 1]
            for c, fit in zip(cameras, fits, strict=True)
        ]
        ends = [float(y) - fit.footing.rear_mm for y, fit in zip(threads, fits, strict=True)]
        origin = around.datum_mm.copy()
        origin[1] = float(np.floor(min(behind, *ends) - SPARE_MM))
        return rotated(PLATE_AXES, origin)

    def _best(
        self, camera: RigCamera, found: Iterable[WedgeFit], face: Floats, site: Site
    ) -> Posted:
        """The first post and wedge without a clash, else the one with the fewest."""
        best: tuple[int, Posted] | None = None
        for fit in found:
            option = post_for(camera, fit, face, self.profile)
            if option is None:
                continue
            count = site.clashes(option.solids(), pairs(*option.touching()))
            if best is None or count < best[0]:
                best = (count, option)
            if count == 0:
                break
        if best is None:
            raise InputError(
                "post-long",
                f"{camera.name} stands too far before the plate for a post of "
                f"{LONGEST_POST_MM:.0f} mm, the longest there is",
                "choose a frame or an arc, or ask for a design with cameras less deep",
            )
        return best[1]


@dataclass(frozen=True, eq=False)
class PlateHolding:
    """Cameras on the posts of a plate."""

    system: PlateSystem
    posted: tuple[Posted, ...]
    face: Floats
    around: Surroundings

    @property
    def mounts(self) -> tuple[CameraMount, ...]:
        """In the order of the cameras."""
        return tuple(p.mount for p in self.posted)

    def with_mounts(self, mounts: tuple[CameraMount, ...]) -> Self:
        """The same posts at other figures."""
        posted = tuple(replace(p, mount=m) for p, m in zip(self.posted, mounts, strict=True))
        return replace(self, posted=posted)

    def with_stays(self) -> Self:
        """See :class:`rig.build.mounts.systems.base.Holding`."""
        return replace(self, system=replace(self.system, stays=True))

    def with_spread(self, spread: Spread) -> Self:
        """See :class:`rig.build.mounts.systems.base.Holding`."""
        return replace(self, system=replace(self.system, spread=spread))

    def build(self) -> Built:
        """See :class:`rig.build.mounts.systems.base.Holding`."""
        low, high = self._extent()
        plate = self._plate(low, high)
        stand = self._stand(low, high)
        stays = self._stays(stand)
        members = (*stand, *stays.members, *(p.member() for p in self.posted))
        thick = self.system.thickness_mm
        solids = [box("plate", "plate", self.face, np.append(low, -thick), np.append(high, 0.0))]
        solids += [
            bar(m.id, "member", m.axis_mm[0], m.axis_mm[1], m.across, m.size_mm)
            for m in (*stand, *stays.members)
        ]
        solids += [s for p in self.posted for s in (*p.solids(), *camera_solids(p.mount.camera))]
        solids += stays.solids
        wedges = tuple(p.wedge() for p in self.posted)
        joints = (
            *self._stand_joints(stand),
            *stays.joints,
            *(j for p in self.posted for j in self._joints(p)),
        )
        touching = [t for p in self.posted for t in p.touching()]
        touching += [("plate", p.post_id) for p in self.posted] + [(j.on, j.other) for j in joints]
        touching += stays.touching()
        structure = Structure(members, (plate,), wedges, stays.parts, joints, tuple(solids))
        mounts = tuple(self._measured(p) for p in self.posted)
        structure, joined = levelled(structure, pairs(*touching), self.system.levelling)
        structure, joined = with_corners(
            structure, joined, self.system.corner, tuple(m.camera for m in mounts),
            self.around,
        )  # fmt: skip
        return Built(structure, mounts, joined, unplaced(structure, self.system.corner))

    def _extent(self) -> tuple[Floats, Floats]:
        """Least and greatest corner of the plate in its own plane, whole centimetres."""
        feet = np.stack([self._on_plate(p.foot()[:3, 3]) for p in self.posted])
        low, high = feet.min(axis=0) - EDGE_MM, feet.max(axis=0) + EDGE_MM
        return np.floor(low / 10.0) * 10.0, np.ceil(high / 10.0) * 10.0

    def _on_plate(self, point_mm: Floats) -> Floats:
        return np.asarray((self.face[:3, :3].T @ (point_mm - self.face[:3, 3]))[:2])

    def _plate(self, low: Floats, high: Floats) -> Plate:
        profile = self.system.profile
        hole = SCREW_HOLES_MM.get(profile.bolt or "", 5.5)
        holes = []
        for post in self.posted:
            foot = post.foot()
            for k, sign in enumerate((-1.0, 1.0), 1):
                point = foot[:3, 3] + sign * profile.height_mm / 4.0 * foot[:3, 1]
                x, y = self._on_plate(point)
                holes.append(Hole(f"{post.mount.name} {k}", float(x), float(y), hole, "through",
                                  profile.bolt or ""))  # fmt: skip
        inset = profile.width_mm / 2.0
        for label, x, y in (
            ("S1", low[0] + inset, low[1] + inset), ("S2", low[0] + inset, high[1] - inset),
            ("S3", high[0] - inset, low[1] + inset), ("S4", high[0] - inset, high[1] - inset),
        ):  # fmt: skip
            holes.append(Hole(label, float(x), float(y), hole, "through", profile.bolt or ""))
        outline = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
        return Plate(
            "plate", self.system.material, self.system.thickness_mm, self.face, outline,
            tuple(holes),
        )  # fmt: skip

    def _stand(self, low: Floats, high: Floats) -> list[Member]:
        """Two uprights behind the plate's edges, a foot under each, and a bar between them."""
        profile = self.system.profile
        size = (profile.width_mm, profile.height_mm)
        depth = -self.system.thickness_mm - profile.height_mm / 2.0
        floor = base_z_mm(self.around, self.system.levelling) - float(self.face[2, 3])
        out = []
        for name, x in (("left", high[0]), ("right", low[0])):
            at = x + (-profile.width_mm / 2.0 if x > 0.0 else profile.width_mm / 2.0)
            beside = at + (profile.width_mm if x > 0.0 else -profile.width_mm)
            level = floor + profile.height_mm / 2.0
            front = depth + FOOT_MM + self.system.spread.front_mm
            lines = {
                "upright": ([at, floor, depth], [at, high[1], depth]),
                "foot": ([beside, level, depth - self._behind_mm], [beside, level, front]),
            }
            for role, line in lines.items():
                axis = carried(self.face, np.array(line))
                out.append(Member(f"{name} {role}", profile.id, role, axis, X, size))
        half = profile.width_mm
        z = floor + 2.0 * profile.height_mm
        axis = carried(self.face, np.array([[high[0] - half, z, depth], [low[0] + half, z, depth]]))
        # Its broad side level: so its slots lie on those of the uprights, for the brackets.
        out.append(Member("cross bar", profile.id, "cross bar", axis, Z, size))
        return out

    @property
    def _behind_mm(self) -> float:
        return FOOT_MM + self.system.spread.rear_mm

    def _stays(self, stand: list[Member]) -> Stays:
        """A sill and a stay for each upright, where the plate has them."""
        if not self.system.stays:
            return Stays()
        system, (left, left_foot, right, right_foot, _) = self.system, stand
        parts = StayParts(system.profile, system.corner, system.pivot, system.screw, system.t_nut)
        return stayed("of the plate", [left, right], [left_foot, right_foot], parts)

    def _stand_joints(self, stand: list[Member]) -> list[Joint]:
        system = self.system
        two = {system.corner.id: 2, system.screw: 4, system.t_nut: 4}
        left, left_foot, right, right_foot, cross = stand
        out = []
        for upright, foot, end in ((left, left_foot, 0), (right, right_foot, 1)):
            out.append(Joint(f"{foot.id} a", foot.id, upright.id, upright.axis_mm[0],
                             self._behind_mm, None,
                             two))  # fmt: skip
            along = float(cross.axis_mm[end, 2] - upright.axis_mm[0, 2])
            out.append(Joint(f"{upright.id} a", upright.id, cross.id, cross.axis_mm[end], along,
                             None, two))  # fmt: skip
            bolts = {system.screw: 2, system.t_nut: 2}
            out.append(
                Joint(f"{upright.id} b", upright.id, "plate", upright.axis_mm[1],
                      upright.length_mm, None, bolts)
            )  # fmt: skip
        return out

    def _joints(self, posted: Posted) -> tuple[Joint, ...]:
        system, name = self.system, posted.mount.name
        post, foot = posted.member(), posted.foot()
        base, seat = posted.base(), posted.base() @ posted.fit.wedge.base_from_seat
        return (
            Joint(f"{name} a", "plate", post.id, foot[:3, 3], None, None, {system.screw: 2}),
            Joint(f"{name} b", post.id, posted.wedge_id, base[:3, 3],
                  posted.wedge_along_mm, None,
                  {system.screw: 4, system.t_nut: 4}),
            Joint(f"{name} c", posted.wedge_id, name, seat[:3, 3], None, None,
                  {CAMERA_SCREW: 1}),
        )  # fmt: skip

    def _measured(self, posted: Posted) -> CameraMount:
        front, name = lens_front(posted.mount.camera), posted.mount.name
        low, _ = self._extent()
        corner = carried(self.face, np.array([[low[0], low[1], 0.0]]))[0]
        tapes = (
            Tape("datum", f"lens front of {name}",
                 float(np.linalg.norm(front - self.around.datum_mm))),
            Tape("lower left corner of the plate's face, seen from the subject",
                 f"lens front of {name}", float(np.linalg.norm(front - corner))),
        )  # fmt: skip
        carried_by = ("plate", posted.post_id, posted.wedge_id)
        return replace(posted.mount, carried_by=carried_by, tapes=tapes)
