"""The T-slot frame: bays of uprights behind the cameras, stubs, arms and heads.

A bay stands square behind the cameras that look its way: one for the cameras in front of the
subject, one for each side, one behind. Uprights are set on whole millimetres and stay; each
camera has its height on its upright, its place across on the stub and its reach on the arm.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.build.mounts.clashes import pairs
from rig.build.mounts.kinematics import rotated
from rig.build.mounts.settings import CameraMount, Link, Motion, Setting, Tape, shift, turn
from rig.build.mounts.solids import bar, camera_solids, lens_front
from rig.build.mounts.structure import Joint, Member, Solid, Structure
from rig.build.mounts.surroundings import Surroundings
from rig.build.mounts.systems.base import USUAL, Built, Spread
from rig.build.mounts.systems.corners import leg_mm, unplaced, with_corners
from rig.build.mounts.systems.hanging import Rail, hang_all, spread_order
from rig.build.mounts.systems.heads import HeadKind
from rig.build.mounts.systems.levelling import base_z_mm, levelled
from rig.build.mounts.systems.outrigger import Hung, Outrigger, X, Y, Z
from rig.build.mounts.systems.stays import Stays, stayed
from rig.build.mounts.systems.ties import tied
from rig.catalogue.items import Profile

BEHIND_MM = 90.0
"""From the rearmost cable of a bay to the middle of its uprights: room for stubs."""

OVER_MM = 80.0
FOOT_MM = (300.0, 350.0)
SHORT_FOOT_MM = 60.0
"""How far a foot reaches forward where another bay stands beside: together they stand firm."""

NARROWEST_MM = 500.0
OPEN_CORNER = 2
"""Of a ring of four bays: behind the subject, between the bay there and the next."""

END_MM = 6.0
"""Between the bracket beside the last upright of a bay and that of its foot."""

SIDE_DEG = 60.0
"""Cameras more to the side than this get a bay of their own: an arm along the subject's view
would have to be longer than the camera is far."""


@dataclass(frozen=True, eq=False)
class Upright:
    """An upright whose foot's middle is at ``rig_from_foot`` (4, 4), x across, y to the subject."""

    id: str
    profile: Profile
    rig_from_foot: Floats
    across_mm: float
    bay: int
    length_mm: float
    step_mm: float

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width across and depth."""
        return self.profile.width_mm, self.profile.height_mm

    def setting(self) -> Setting:
        """Height of the stub."""
        return Setting(
            "height", "mm", self.length_mm / 2.0, self.step_mm, 0.0, self.length_mm,
            f"the foot of {self.id} to the lower edge of the stub",
        )  # fmt: skip

    def links(self) -> tuple[Link, ...]:
        """Up the upright by the height, to the middle of the stub."""
        return (Link(self._base(), Motion.SLIDE, Z, "height"),)

    def _base(self) -> Floats:
        return np.asarray(self.rig_from_foot @ shift(self.profile.height_mm / 2.0 * Z))

    def at(self, value: float) -> Floats:
        """The stub's frame at a height."""
        return np.asarray(self._base() @ shift(value * Z))

    def frame_for(self, point_mm: Floats) -> Floats:
        """The stub's frame at the height of a point."""
        return self.at(float(point_mm[2] - self._base()[2, 3]))


@dataclass(frozen=True, eq=False)
class Bay:
    """A row of uprights: ``turn_deg`` about the vertical from the front bay."""

    index: int
    turn_deg: float
    plane_mm: float
    length_mm: float

    def axes(self) -> Floats:
        """Rotation (3, 3) of the bay."""
        return turn(Z, self.turn_deg)


class _Bays:
    """The uprights of a frame in the making."""

    def __init__(self, system: TSlotSystem, bays: dict[str, Bay], around: Surroundings) -> None:
        self._system, self._bay_of, self._around = system, bays, around
        self.uprights: list[Upright] = []

    def options(self, camera: RigCamera) -> Iterable[Rail]:
        bay = self._bay_of[camera.name]
        place = float(bay.axes()[:, 0] @ (camera.pose.position_rig_mm - self._around.datum_mm))
        share = self._system.share_mm
        mine = [u for u in self.uprights if u.bay == bay.index]
        standing = sorted(mine, key=lambda u: abs(u.across_mm - place))
        near = [u for u in standing if abs(u.across_mm - place) <= share]
        free = self._system.outrigger.profile.width_mm + 10.0
        new = [
            self._upright(bay, round(place) + offset)
            for offset in (0, 25, -25, 50, -50, 100, -100)
            if all(abs(u.across_mm - round(place) - offset) >= free for u in mine)
        ]
        return [*near, *new, *(u for u in standing if u not in near)]

    def _upright(self, bay: Bay, across_mm: float) -> Upright:
        axes, datum = bay.axes(), self._around.datum_mm
        foot = datum + axes @ np.array([across_mm, bay.plane_mm, 0.0])
        foot[2] = base_z_mm(self._around, self._system.outrigger.levelling)
        profile = self._system.outrigger.profile
        name = f"U{len(self.uprights) + 1}"
        at = rotated(axes, foot)
        step = self._system.step_mm
        return Upright(name, profile, at, float(across_mm), bay.index, bay.length_mm, step)

    def keep(self, rail: Rail) -> None:
        if isinstance(rail, Upright) and rail not in self.uprights:
            self.uprights.append(rail)

    def solids(self, rail: Rail) -> tuple[Solid, ...]:
        if not isinstance(rail, Upright) or rail in self.uprights:
            return ()
        return (_upright_solid(_upright_member(rail)),)


@dataclass(frozen=True, eq=False)
class TSlotSystem:
    """A frame of T-slot profile. ``share_mm``: how far from an upright a stub may reach.

    ``stays``: with a stay behind each upright.
    """

    outrigger: Outrigger
    step_mm: float
    share_mm: float
    stays: bool = False
    spread: Spread = USUAL
    kind: str = "t-slot"

    @property
    def head(self) -> HeadKind:
        """The head of every camera."""
        return self.outrigger.head

    @property
    def steps(self) -> tuple[float, float]:
        """Steps of slides and head."""
        return self.step_mm, self.outrigger.head.step_deg

    def hold(self, cameras: tuple[RigCamera, ...], around: Surroundings) -> TSlotHolding:
        """See :class:`rig.build.mounts.systems.base.MountSystem`."""
        bay_of = _bays(cameras, around, base_z_mm(around, self.outrigger.levelling))
        bays = _Bays(self, bay_of, around)
        order = spread_order(cameras)
        hung = hang_all(cameras, around, bays, self.outrigger, self.step_mm, order)
        used = tuple({bay.index: bay for bay in bay_of.values()}.values())
        return TSlotHolding(self, hung, tuple(bays.uprights), used, around)


def _bays(cameras: tuple[RigCamera, ...], around: Surroundings, base_mm: float) -> dict[str, Bay]:
    """The bay of each camera by name; all bays are as tall as the highest camera needs.

    ``base_mm``: height of their undersides.
    """
    index_of: dict[str, int] = {}
    for camera in cameras:
        away = camera.pose.position_rig_mm - around.centroid_mm
        azimuth = float(np.degrees(np.arctan2(away[0], -away[1])))
        quarter = 0 if abs(azimuth) <= SIDE_DEG else int(np.round(azimuth / 90.0))
        index_of[camera.name] = quarter % 4
    top = max(float(c.pose.position_rig_mm[2]) for c in cameras) - base_mm
    length = float(np.ceil((top + 2.0 * OVER_MM) / 10.0) * 10.0)
    bays = {}
    for index in sorted(set(index_of.values())):
        mine = [c for c in cameras if index_of[c.name] == index]
        axes = turn(Z, 90.0 * index)
        corners = np.concatenate([s.corners_mm for c in mine for s in camera_solids(c)])
        rear = float(((corners - around.datum_mm) @ axes[:, 1]).min())
        bays[index] = Bay(index, 90.0 * index, float(np.floor(rear - BEHIND_MM)), length)
    return {name: bays[index] for name, index in index_of.items()}


def _upright_member(upright: Upright) -> Member:
    foot = upright.rig_from_foot
    axis = np.stack([foot[:3, 3], foot[:3, 3] + upright.length_mm * Z])
    return Member(upright.id, upright.profile.id, "upright", axis, foot[:3, 0], upright.size_mm)


def _upright_solid(member: Member) -> Solid:
    return bar(
        member.id, "member", member.axis_mm[0], member.axis_mm[1], member.across, member.size_mm
    )


@dataclass(frozen=True, eq=False)
class TSlotHolding:
    """Cameras on the uprights of a frame."""

    system: TSlotSystem
    hung: tuple[Hung, ...]
    uprights: tuple[Upright, ...]
    bays: tuple[Bay, ...]
    around: Surroundings

    @property
    def mounts(self) -> tuple[CameraMount, ...]:
        """In the order of the cameras."""
        return tuple(h.mount for h in self.hung)

    def with_mounts(self, mounts: tuple[CameraMount, ...]) -> Self:
        """The same frame with stubs, arms and heads set anew."""
        of = {u.id: u for u in self.uprights}
        hung = tuple(
            replace(h, mount=m, rig_from_rail=of[h.rail].at(m.values()["height"]))
            for h, m in zip(self.hung, mounts, strict=True)
        )
        return replace(self, hung=hung)

    def with_stays(self) -> Self:
        """See :class:`rig.build.mounts.systems.base.Holding`."""
        return replace(self, system=replace(self.system, stays=True))

    def with_spread(self, spread: Spread) -> Self:
        """See :class:`rig.build.mounts.systems.base.Holding`."""
        return replace(self, system=replace(self.system, spread=spread))

    def build(self) -> Built:
        """See :class:`rig.build.mounts.systems.base.Holding`."""
        uprights = [_upright_member(u) for u in self.uprights]
        bases = [m for bay in self.bays for m in self._base(bay)]
        stays = self._stays(uprights) + self._ties()
        bases += stays.members
        members = [*uprights, *bases, *(m for h in self.hung for m in h.members())]
        solids = [_upright_solid(m) for m in (*uprights, *bases)]
        solids += [s for h in self.hung for s in (*h.solids(), *camera_solids(h.mount.camera))]
        solids += stays.solids
        joints = [*(j for bay in self.bays for j in self._base_joints(bay)), *stays.joints]
        half = self.system.outrigger.profile.height_mm / 2.0
        joints += [j for h in self.hung for j in h.joints(h.mount.values()["height"] + half)]
        touching = [p for h in self.hung for p in h.touching()]
        touching += [(j.on, j.other) for j in joints] + stays.touching()
        parts = (*(p for h in self.hung for p in h.placed()), *stays.parts)
        structure = Structure(tuple(members), (), (), parts, tuple(joints), tuple(solids))
        mounts = tuple(self._measured(h) for h in self.hung)
        structure, joined = levelled(structure, pairs(*touching), self.system.outrigger.levelling)
        structure, joined = with_corners(
            structure, joined, self.system.outrigger.corner,
            tuple(m.camera for m in mounts), self.around,
        )  # fmt: skip
        return Built(structure, mounts, joined, unplaced(structure, self.system.outrigger.corner))

    def _measured(self, hung: Hung) -> CameraMount:
        upright = next(u for u in self.uprights if u.id == hung.rail)
        front = lens_front(hung.mount.camera)
        foot = upright.rig_from_foot
        mark = foot[:3, 3] + upright.size_mm[1] / 2.0 * foot[:3, 1]
        tapes = (
            Tape("datum", f"lens front of {hung.mount.name}", _far(front, self.around.datum_mm)),
            Tape(
                f"front of the foot of {upright.id}", f"lens front of {hung.mount.name}",
                _far(front, mark),
            ),
        )  # fmt: skip
        parts = (upright.id, hung.stub_id, hung.arm_id, *(p.id for p in hung.placed()))
        return replace(hung.mount, carried_by=parts, tapes=tapes)

    def _ends(self, bay: Bay) -> tuple[float, float]:
        places = [u.across_mm for u in self.uprights if u.bay == bay.index]
        parts = self.system.outrigger
        beyond = parts.profile.width_mm / 2.0 + 2.0 * leg_mm(parts.corner)[0] + END_MM
        low, high = min(places) - beyond, max(places) + beyond
        more = max(0.0, NARROWEST_MM - (high - low)) / 2.0 + self.system.spread.beside_mm
        return float(np.floor(low - more)), float(np.ceil(high + more))

    @property
    def _behind_mm(self) -> float:
        return FOOT_MM[0] + self.system.spread.rear_mm

    def _base(self, bay: Bay) -> list[Member]:
        """Bottom and top rail behind the uprights, and a foot at each end of the bottom rail."""
        part, axes = self.system.outrigger.profile, bay.axes()
        width, height = part.width_mm, part.height_mm
        low, high = self._ends(bay)
        back = bay.plane_mm - height / 2.0 - width / 2.0
        floor = base_z_mm(self.around, self.system.outrigger.levelling) - self.around.datum_mm[2]
        forward = FOOT_MM[1] if len(self.bays) == 1 else SHORT_FOOT_MM
        forward += self.system.spread.front_mm

        def member(role: str, start: list[float], end: list[float], across: Floats) -> Member:
            axis = self.around.datum_mm + np.array([start, end]) @ axes.T
            name = f"{role} {bay.index + 1}"
            return Member(name, part.id, role, axis, axes @ across, (width, height))

        rails = [
            member(role, [low, back, z], [high, back, z], Y)
            for role, z in (
                ("bottom rail", floor + height / 2.0),
                ("top rail", floor + bay.length_mm - height / 2.0),
            )
        ]
        feet = [
            member(role, [x, back - self._behind_mm, z], [x, back + forward, z], X)
            for role, x, z in (
                ("left foot", low - width / 2.0, floor + height / 2.0),
                ("right foot", high + width / 2.0, floor + height / 2.0),
            )
        ]
        return rails + feet

    def _stays(self, uprights: list[Member]) -> Stays:
        """A sill and stays behind each bay, where the frame has them."""
        made = Stays()
        for bay in self.bays if self.system.stays else ():
            mine = {u.id for u in self.uprights if u.bay == bay.index}
            standing = [m for m in uprights if m.id in mine]
            feet, parts = self._base(bay)[2:], self.system.outrigger.stay_parts
            made += stayed(str(bay.index + 1), standing, feet, parts)
        return made

    def _ties(self) -> Stays:
        """What makes one body of bays that stand beside each other, where that is asked for.

        Of four bays one corner stays open: the subject has to get in.
        """
        made = Stays()
        standing = {bay.index: bay for bay in self.bays} if self.system.spread.tied else {}
        for bay in standing.values():
            beside = standing.get((bay.index + 1) % 4)
            if beside is not None and (len(standing) < 4 or bay.index != OPEN_CORNER):
                _, _, _, right = self._base(bay)
                _, _, left, _ = self._base(beside)
                name = f"{bay.index + 1}-{beside.index + 1}"
                made += tied(name, right, left, self.system.outrigger.stay_parts)
        return made

    def _base_joints(self, bay: Bay) -> list[Joint]:
        bottom, top, left, right = self._base(bay)
        parts = self.system.outrigger
        two = {parts.corner.id: 2, parts.screw: 4, parts.t_nut: 4}
        low, _ = self._ends(bay)
        out = []
        for upright in (u for u in self.uprights if u.bay == bay.index):
            for rail in (bottom, top):
                point = rail.axis_mm[0] + (upright.across_mm - low) * bay.axes()[:, 0]
                name = f"{upright.id} {rail.role}"
                out.append(
                    Joint(name, rail.id, upright.id, point, upright.across_mm - low, None, two)
                )
        for foot, end in ((left, 0), (right, 1)):
            point = bottom.axis_mm[end]
            out.append(Joint(foot.id, foot.id, bottom.id, point, self._behind_mm, None, two))
        return out


def _far(one: Floats, other: Floats) -> float:
    return float(np.linalg.norm(one - other))
