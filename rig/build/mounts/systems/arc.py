"""The arc: ribs about the subject, each a polygon of straight profile in an upright plane.

Rails with slots are not sold bent, and a bent one would turn a camera as it moves it, so that no
slide could make up for a rounded tilt. All ribs have the same facets. A stub sits on a facet as
on an upright of a frame; its arm is square to the facet. Each rib leans on an upright behind it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.build.mounts.clashes import pairs
from rig.build.mounts.settings import CameraMount, Tape
from rig.build.mounts.solids import bar, camera_solids, lens_front
from rig.build.mounts.structure import Joint, Member, Solid, Structure
from rig.build.mounts.surroundings import Surroundings
from rig.build.mounts.systems.base import Built
from rig.build.mounts.systems.hanging import Rail, hang_all
from rig.build.mounts.systems.heads import HeadKind
from rig.build.mounts.systems.outrigger import Hung, Outrigger, Z
from rig.build.mounts.systems.ribs import Facet, Rib
from rig.build.mounts.systems.stays import stayed

BEHIND_MM = 90.0
END_DEG = 10.0
"""How far a rib reaches past the outermost cameras, in degrees of its arc."""

FACET_DEG = 24.0
"""Longest facet, in degrees of the arc."""

STRUT_MM = 30.0
"""From the end of a rib to the middle of the joint of its strut."""

TURNS_DEG = (0.0, 3.0, -3.0, 6.0, -6.0, 10.0, -10.0)
FOOT_MM = (300.0, 120.0)


class _Ribs:
    """The ribs of an arc in the making."""

    def __init__(self, system: ArcSystem, shape: Rib) -> None:
        self._system, self._shape = system, shape
        self.ribs: list[Rib] = []

    def options(self, camera: RigCamera) -> Iterable[Rail]:
        point = camera.pose.position_rig_mm
        away = point - self._shape.centre_mm
        azimuth = float(np.round(np.degrees(np.arctan2(away[0], -away[1]))))
        far = float(np.hypot(away[0], away[1]))

        def beside(rib: Rib) -> float:
            return far * abs(float(np.sin(np.radians(rib.turn_deg - azimuth))))

        near = sorted(self.ribs, key=beside)
        free = np.degrees(4.0 * self._shape.profile.width_mm / self._shape.radius_mm)
        new = [
            replace(self._shape, id=f"A{len(self.ribs) + 1}", turn_deg=azimuth + offset)
            for offset in TURNS_DEG
            if all(abs(r.turn_deg - azimuth - offset) >= free for r in self.ribs)
        ]
        shared = [rib for rib in near if beside(rib) <= self._system.share_mm]
        rest = [rib for rib in near if rib not in shared]
        return [facet for rib in (*shared, *new, *rest) for facet in rib.nearest(point)[:2]]

    def keep(self, rail: Rail) -> None:
        if isinstance(rail, Facet) and rail.rib not in self.ribs:
            self.ribs.append(rail.rib)

    def solids(self, rail: Rail) -> tuple[Solid, ...]:
        if not isinstance(rail, Facet) or rail.rib in self.ribs:
            return ()
        return tuple(facet.solid() for facet in rail.rib.facets)


@dataclass(frozen=True, eq=False)
class ArcSystem:
    """Ribs on uprights. ``radius_mm`` None: as small as the cameras allow.

    ``stays``: with a stay behind each upright.
    """

    outrigger: Outrigger
    step_mm: float
    share_mm: float
    radius_mm: float | None = None
    stays: bool = False
    kind: str = "arc"

    @property
    def head(self) -> HeadKind:
        """The head of every camera."""
        return self.outrigger.head

    @property
    def steps(self) -> tuple[float, float]:
        """Steps of slides and head."""
        return self.step_mm, self.outrigger.head.step_deg

    def hold(self, cameras: tuple[RigCamera, ...], around: Surroundings) -> ArcHolding:
        """See :class:`rig.build.mounts.systems.base.MountSystem`."""
        shape = self._shape(cameras, around)
        try:
            return self._held(cameras, around, shape)
        except InputError as error:
            if error.detail != "mount-reach" or self.radius_mm is None:
                raise
            own = replace(self, radius_mm=None)._shape(cameras, around).radius_mm
            raise InputError(
                "arc-radius",
                f"{error.problem} of an arc with a radius of {self.radius_mm:g} mm",
                f"give a radius_mm of about {own:.0f}, or leave it out",
            ) from error

    def _held(self, cameras: tuple[RigCamera, ...], around: Surroundings, shape: Rib) -> ArcHolding:
        ribs = _Ribs(self, shape)
        away = np.stack([c.pose.position_rig_mm for c in cameras]) - shape.centre_mm
        order = [int(k) for k in np.argsort(np.arctan2(away[:, 0], -away[:, 1]))]
        hung = hang_all(cameras, around, ribs, self.outrigger, self.step_mm, order)
        return ArcHolding(self, hung, tuple(ribs.ribs), around)

    def _shape(self, cameras: tuple[RigCamera, ...], around: Surroundings) -> Rib:
        """Radius, span and facets that all ribs share."""
        centre = np.round(around.centroid_mm)
        corners = np.concatenate([s.corners_mm for c in cameras for s in camera_solids(c)])
        needed = float(np.linalg.norm(corners - centre, axis=1).max()) + BEHIND_MM
        away = np.stack([c.pose.position_rig_mm for c in cameras]) - centre
        height = np.degrees(np.arctan2(away[:, 2], np.hypot(away[:, 0], away[:, 1])))
        low = max(float(np.floor(min(height.min(), 0.0) - END_DEG)), -80.0)
        high = min(float(np.ceil(max(height.max(), 0.0) + END_DEG)), 85.0)
        count = int(np.ceil((high - low) / FACET_DEG))
        half = float(np.radians((high - low) / count / 2.0))
        # The middle of a facet lies nearer to the centre than its corners; facets are cut to
        # whole millimetres.
        own = _whole_facets(needed / float(np.cos(half)), half)
        if self.radius_mm is not None and self.radius_mm < needed - BEHIND_MM:
            raise InputError(
                "arc-radius",
                f"an arc with a radius of {self.radius_mm:g} mm does not go round the cameras",
                f"give a radius_mm of {np.ceil(own):.0f} or more, or leave it out",
            )
        radius = own if self.radius_mm is None else _whole_facets(self.radius_mm, half)
        profile = self.outrigger.profile
        return Rib("", profile, centre, 0.0, radius, low, high, count, self.step_mm)


@dataclass(frozen=True, eq=False)
class ArcHolding:
    """Cameras on the ribs of an arc."""

    system: ArcSystem
    hung: tuple[Hung, ...]
    ribs: tuple[Rib, ...]
    around: Surroundings

    @property
    def mounts(self) -> tuple[CameraMount, ...]:
        """In the order of the cameras."""
        return tuple(h.mount for h in self.hung)

    def with_mounts(self, mounts: tuple[CameraMount, ...]) -> Self:
        """The same ribs with stubs, arms and heads set anew."""
        of = {facet.id: facet for rib in self.ribs for facet in rib.facets}
        hung = tuple(
            replace(h, mount=m, rig_from_rail=of[h.rail].at(m.values()["along"]))
            for h, m in zip(self.hung, mounts, strict=True)
        )
        return replace(self, hung=hung)

    def with_stays(self) -> Self:
        """See :class:`rig.build.mounts.systems.base.Holding`."""
        return replace(self, system=replace(self.system, stays=True))

    def build(self) -> Built:
        """See :class:`rig.build.mounts.systems.base.Holding`."""
        facets = [facet for rib in self.ribs for facet in rib.facets]
        props = [m for rib in self.ribs for m in self._props(rib)]
        bars = self._base_bars()
        stays, stay_joints = self._stays()
        props += stays
        members = [f.member() for f in facets] + props + bars
        members += [m for h in self.hung for m in h.members()]
        solids = [facet.solid() for facet in facets]
        solids += [
            bar(m.id, "member", m.axis_mm[0], m.axis_mm[1], m.across, m.size_mm)
            for m in (*props, *bars)
        ]
        solids += [s for h in self.hung for s in (*h.solids(), *camera_solids(h.mount.camera))]
        joints = [j for rib in self.ribs for j in self._joints(rib)] + self._base_joints(bars)
        joints += stay_joints
        joints += [j for h in self.hung for j in h.joints(h.mount.values()["along"])]
        touching = [p for h in self.hung for p in h.touching()] + [(j.on, j.other) for j in joints]
        # Feet and base bars meet at the uprights.
        floor = [m.id for m in (*props, *bars) if m.role in ("foot", "base bar")]
        touching += [(a, b) for a in floor for b in floor if a < b]
        parts = tuple(p for h in self.hung for p in h.placed())
        structure = Structure(tuple(members), (), (), parts, tuple(joints), tuple(solids))
        return Built(structure, tuple(self._measured(h) for h in self.hung), pairs(*touching))

    def _measured(self, hung: Hung) -> CameraMount:
        rib = next(r for r in self.ribs if hung.rail.startswith(f"{r.id}."))
        front, name = lens_front(hung.mount.camera), hung.mount.name
        low = rib.facets[0].at(0.0)
        mark = low[:3, 3] + rib.profile.height_mm / 2.0 * low[:3, 1]
        tapes = (
            Tape("datum", f"lens front of {name}", _far(front, self.around.datum_mm)),
            Tape(f"inner edge of the lower end of {rib.id}.1", f"lens front of {name}",
                 _far(front, mark)),
        )  # fmt: skip
        placed = (p.id for p in hung.placed())
        parts = (f"{rib.id} upright", hung.rail, hung.stub_id, hung.arm_id, *placed)
        return replace(hung.mount, carried_by=parts, tapes=tapes)

    def _props(self, rib: Rib) -> list[Member]:
        """The upright behind a rib, its foot, and a strut to each end of the rib."""
        profile = rib.profile
        size = (profile.width_mm, profile.height_mm)
        back = -(rib.radius_mm + 1.5 * profile.height_mm)
        floor = self.around.floor_z_mm - rib.centre_mm[2]
        high = float(rib.corner(rib.count)[2] - rib.centre_mm[2])

        def member(role: str, start: list[float], end: list[float]) -> Member:
            axis = rib.centre_mm + np.array([start, end]) @ rib.axes.T
            name = f"{rib.id} {role}"
            return Member(name, profile.id, role.split()[-1], axis, rib.axes[:, 0], size)

        top = floor + float(np.ceil(max(high, 0.0) + 2.0 * profile.height_mm - floor))
        out = [member("upright", [0.0, back, floor], [0.0, back, top])]
        foot, aside = floor + profile.height_mm / 2.0, profile.width_mm
        out.append(
            member("foot", [aside, back - FOOT_MM[0], foot], [aside, back + FOOT_MM[1], foot])
        )
        front = back + profile.height_mm / 2.0
        for role, facet in (("lower strut", rib.facets[0]), ("upper strut", rib.facets[-1])):
            end = rib.axes.T @ (self._strut_end(rib, facet) - rib.centre_mm)
            length = np.floor(float(end[1]) - front)
            if length > profile.height_mm and end[2] > floor + 3.0 * profile.height_mm:
                z = float(end[2])
                out.append(member(role, [0.0, front, z], [0.0, front + float(length), z]))
        return out

    def _strut_end(self, rib: Rib, facet: Facet) -> Floats:
        """The axis of the pivot joint on a facet's rear, near the end of its rib, (3,)."""
        along = STRUT_MM if facet.index == 0 else facet.length_mm - STRUT_MM
        joint = (self.system.outrigger.pivot.size_mm or (20.0, 40.0, 20.0))[1]
        at = facet.at(along)
        return np.asarray(at[:3, 3] - (rib.profile.height_mm / 2.0 + joint) * at[:3, 1])

    def _joints(self, rib: Rib) -> list[Joint]:
        """Facet to facet, upright to rib, foot to upright, struts between."""
        parts = self.system.outrigger
        two = {parts.corner.id: 2, parts.screw: 4, parts.t_nut: 4}
        pivot = {parts.pivot.id: 1, parts.screw: 2, parts.t_nut: 2}
        upright, foot, *struts = self._props(rib)
        bend = (rib.high_deg - rib.low_deg) / rib.count
        out = [
            Joint(f"{b.id} bend", a.id, b.id, b.ends_mm[0], a.length_mm, bend, pivot)
            for a, b in pairwise(rib.facets)
        ]
        # The facet that comes nearest to the upright is bolted to it.
        nearest = min(rib.facets, key=lambda f: abs(float(f.middle_mm[2] - rib.centre_mm[2])))
        level = float(nearest.middle_mm[2] - upright.axis_mm[0, 2])
        out += [
            Joint(f"{rib.id} a", upright.id, nearest.id, nearest.middle_mm, level, None, pivot),
            Joint(f"{rib.id} b", foot.id, upright.id, upright.axis_mm[0], FOOT_MM[0], None, two),
        ]
        for strut in struts:
            facet = rib.facets[0] if "lower" in strut.id else rib.facets[-1]
            ends, along = strut.axis_mm, float(strut.axis_mm[0, 2] - upright.axis_mm[0, 2])
            out += [
                Joint(f"{strut.id} a", upright.id, strut.id, ends[0], along, None, two),
                Joint(f"{strut.id} b", strut.id, facet.id, ends[1], strut.length_mm,
                      facet.lean_deg, pivot),
            ]  # fmt: skip
        return out

    def _stays(self) -> tuple[list[Member], list[Joint]]:
        """A sill on each foot and a stay for each upright, where the arc has them."""
        members: list[Member] = []
        joints: list[Joint] = []
        for rib in self.ribs if self.system.stays else ():
            upright, foot = self._props(rib)[:2]
            more, held = stayed(rib.id, [upright], [foot], self.system.outrigger.stay_parts)
            members, joints = members + more, joints + held
        return members, joints

    def _row(self) -> list[Rib]:
        return sorted(self.ribs, key=lambda rib: rib.turn_deg)

    def _base_bars(self) -> list[Member]:
        """Bars from upright to upright, over their feet."""
        out = []
        for k, (one, other) in enumerate(pairwise(self._row()), 1):
            ends = [self._props(rib)[0].axis_mm[0] for rib in (one, other)]
            profile = one.profile
            along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
            # Bars meet the uprights at any angle: on pivots, clear of their edges.
            joint = (self.system.outrigger.pivot.size_mm or (20.0, 40.0, 20.0))[1]
            lift = 1.5 * profile.height_mm * Z
            gap = (joint + float(np.hypot(profile.width_mm, profile.height_mm)) / 2.0) * along
            axis = np.stack([ends[0] + lift + gap, ends[1] + lift - gap])
            size = (profile.width_mm, profile.height_mm)
            across = np.cross(Z, along)
            out.append(Member(f"base bar {k}", profile.id, "base bar", axis, across, size))
        return out

    def _base_joints(self, bars: list[Member]) -> list[Joint]:
        parts = self.system.outrigger
        pivot = {parts.pivot.id: 1, parts.screw: 2, parts.t_nut: 2}
        return [
            Joint(f"{member.id} {mark}", f"{rib.id} upright", member.id, member.axis_mm[end],
                  1.5 * rib.profile.height_mm, _bar_angle_deg(member, rib), pivot)
            for member, ribs in zip(bars, pairwise(self._row()), strict=True)
            for end, (mark, rib) in enumerate(zip("ab", ribs, strict=True))
        ]  # fmt: skip


def _bar_angle_deg(member: Member, rib: Rib) -> float:
    """How far a bar is turned from the line across a rib."""
    along = (member.axis_mm[1] - member.axis_mm[0]) / member.length_mm
    return float(np.degrees(np.arccos(np.clip(abs(along @ rib.axes[:, 0]), 0.0, 1.0))))


def _whole_facets(radius_mm: float, half_rad: float) -> float:
    """The next radius on which facets of twice ``half_rad`` have whole millimetres."""
    return float(np.ceil(2.0 * radius_mm * np.sin(half_rad)) / (2.0 * np.sin(half_rad)))


def _far(one: Floats, other: Floats) -> float:
    return float(np.linalg.norm(one - other))
