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
from rig.build.mounts.structure import Joint, Member, PlacedPart, Solid, Structure
from rig.build.mounts.surroundings import Surroundings
from rig.build.mounts.systems.base import USUAL, Built, Spread
from rig.build.mounts.systems.corners import leg_mm, unplaced, with_corners
from rig.build.mounts.systems.hanging import Rail, hang_all
from rig.build.mounts.systems.heads import HeadKind
from rig.build.mounts.systems.levelling import base_z_mm, levelled
from rig.build.mounts.systems.outrigger import Hung, Outrigger, Z
from rig.build.mounts.systems.pivots import pivot_arm_mm, pivot_bolts, pivot_part
from rig.build.mounts.systems.ribs import Facet, Rib, bend_id, strips
from rig.build.mounts.systems.stays import Stays, stayed
from rig.catalogue.items import Bracket

BEHIND_MM = 90.0
END_DEG = 10.0
"""How far a rib reaches past the outermost cameras, in degrees of its arc."""

FACET_DEG = 24.0
"""Longest facet, in degrees of the arc."""

STRUT_MM = 30.0
"""From the end of a rib to the middle of the joint of its strut."""

TURNS_DEG = (0.0, 3.0, -3.0, 6.0, -6.0, 10.0, -10.0)
FOOT_MM = (300.0, 120.0)
BESIDE_MM = 4.0
"""Between a bracket and the pivot over it."""


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
        bends = (solid for _, solid in strips(rail.rib, self._system.strip))
        return (*(facet.solid() for facet in rail.rib.facets), *bends)


@dataclass(frozen=True, eq=False)
class ArcSystem:
    """Ribs on uprights. ``radius_mm`` None: as small as the cameras allow.

    ``strip`` joins facets where they meet.

    ``stays``: with a stay behind each upright.
    """

    outrigger: Outrigger
    strip: Bracket
    step_mm: float
    share_mm: float
    radius_mm: float | None = None
    stays: bool = False
    spread: Spread = USUAL
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

    def with_spread(self, spread: Spread) -> Self:
        """See :class:`rig.build.mounts.systems.base.Holding`."""
        return replace(self, system=replace(self.system, spread=spread))

    def build(self) -> Built:
        """See :class:`rig.build.mounts.systems.base.Holding`."""
        facets = [facet for rib in self.ribs for facet in rib.facets]
        props = [m for rib in self.ribs for m in self._props(rib)]
        bars = self._base_bars()
        stays = self._stays()
        props += stays.members
        members = [f.member() for f in facets] + props + bars
        members += [m for h in self.hung for m in h.members()]
        solids = [facet.solid() for facet in facets]
        solids += [
            bar(m.id, "member", m.axis_mm[0], m.axis_mm[1], m.across, m.size_mm)
            for m in (*props, *bars)
        ]
        solids += [s for h in self.hung for s in (*h.solids(), *camera_solids(h.mount.camera))]
        solids += stays.solids
        joints = [j for rib in self.ribs for j in self._joints(rib)] + self._base_joints(bars)
        placed, more = self._pivots(joints, bars)
        solids += more
        joints += stays.joints
        joints += [j for h in self.hung for j in h.joints(h.mount.values()["along"])]
        touching = [p for h in self.hung for p in h.touching()] + [(j.on, j.other) for j in joints]
        ends = {joint.id: (joint.on, joint.other) for joint in joints}
        touching += [(part.id, end) for part in placed for end in ends[part.joint]]
        touching += stays.touching()
        parts = (*(p for h in self.hung for p in h.placed()), *placed, *stays.parts)
        structure = Structure(tuple(members), (), (), parts, tuple(joints), tuple(solids))
        mounts = tuple(self._measured(h) for h in self.hung)
        structure, joined = levelled(structure, pairs(*touching), self.system.outrigger.levelling)
        structure, joined = with_corners(
            structure, joined, self.system.outrigger.corner,
            tuple(m.camera for m in mounts), self.around,
        )  # fmt: skip
        return Built(structure, mounts, joined, unplaced(structure, self.system.outrigger.corner))

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
        back = float((rib.axes.T @ (self._hinge(rib)[1] - rib.centre_mm))[1])
        back -= self._arm_mm + profile.height_mm / 2.0
        floor = base_z_mm(self.around, self.system.outrigger.levelling) - rib.centre_mm[2]
        high = float(rib.corner(rib.count)[2] - rib.centre_mm[2])

        def member(role: str, start: list[float], end: list[float]) -> Member:
            axis = rib.centre_mm + np.array([start, end]) @ rib.axes.T
            name = f"{rib.id} {role}"
            return Member(name, profile.id, role.split()[-1], axis, rib.axes[:, 0], size)

        # Over the upper strut there is a bracket.
        strut = float(self._strut_end(rib.facets[-1])[2] - rib.centre_mm[2])
        strut += profile.height_mm / 2.0 + leg_mm(self.system.outrigger.corner)[0] + BESIDE_MM
        top = floor + float(np.ceil(max(max(high, 0.0) + 2.0 * profile.height_mm, strut) - floor))
        out = [member("upright", [0.0, back, floor], [0.0, back, top])]
        foot, aside = floor + profile.height_mm / 2.0, profile.width_mm
        out.append(
            member(
                "foot",
                [aside, back - self._behind_mm, foot],
                [aside, back + FOOT_MM[1] + self.system.spread.front_mm, foot],
            )
        )
        front = back + profile.height_mm / 2.0
        for role, facet in (("lower strut", rib.facets[0]), ("upper strut", rib.facets[-1])):
            end = rib.axes.T @ (self._strut_end(facet) - rib.centre_mm)
            length = np.floor(float(end[1]) - self._arm_mm - front)
            if length > profile.height_mm and end[2] > floor + 3.0 * profile.height_mm:
                z = float(end[2])
                out.append(member(role, [0.0, front, z], [0.0, front + float(length), z]))
        return out

    @property
    def _behind_mm(self) -> float:
        return FOOT_MM[0] + self.system.spread.rear_mm

    @property
    def _arm_mm(self) -> float:
        return pivot_arm_mm(self.system.outrigger.pivot)

    def _hinge(self, rib: Rib) -> tuple[Facet, Floats]:
        """The facet that is bolted to the upright, the nearest to it, and the pin between, (3,)."""
        nearest = min(rib.facets, key=lambda f: abs(float(f.middle_mm[2] - rib.centre_mm[2])))
        return nearest, self._behind(nearest, nearest.length_mm / 2.0)

    def _behind(self, facet: Facet, along_mm: float) -> Floats:
        """The pin of a pivot joint on a facet's rear, (3,)."""
        at = facet.at(along_mm)
        return np.asarray(at[:3, 3] - (facet.size_mm[1] / 2.0 + self._arm_mm) * at[:3, 1])

    def _strut_end(self, facet: Facet) -> Floats:
        """The pin of the pivot joint near the end of its rib, (3,)."""
        along = STRUT_MM if facet.index == 0 else facet.length_mm - STRUT_MM
        return self._behind(facet, along)

    def _pivots(
        self, joints: list[Joint], bars: list[Member]
    ) -> tuple[list[PlacedPart], list[Solid]]:
        """The pivots of ribs, struts and base bars, and the strips at the bends of ribs."""
        pivot = self.system.outrigger.pivot
        of = {joint.id: joint for joint in joints}
        made = []
        for rib in self.ribs:
            pin, forward = rib.axes[:, 0], rib.axes[:, 1]
            facet, place = self._hinge(rib)
            ways = (-forward, facet.at(0.0)[:3, 1])
            made.append(pivot_part(of[f"{rib.id} a"], pivot, place, pin, ways))
            for strut, far in self._struts(rib):
                joint, place = of[f"{strut.id} b"], self._strut_end(far)
                made.append(pivot_part(joint, pivot, place, pin, (-forward, far.at(0.0)[:3, 1])))
        for member, ribs in zip(bars, pairwise(self._row()), strict=True):
            for end, (mark, rib) in enumerate(zip("ab", ribs, strict=True)):
                _, normal, pin_mm = self._bar_pin(rib, ribs[1 - end])
                way = member.axis_mm[end] - pin_mm
                ways = (-normal, way / np.linalg.norm(way))
                made.append(pivot_part(of[f"{member.id} {mark}"], pivot, pin_mm, Z, ways))
        parts = [part for part, _ in made]
        solids = [solid for _, halves in made for solid in halves]
        for rib in self.ribs:
            for part, solid in strips(rib, self.system.strip):
                parts.append(part)
                solids.append(solid)
        return parts, solids

    def _struts(self, rib: Rib) -> list[tuple[Member, Facet]]:
        """The struts of a rib with the facet that each leads to."""
        _, _, *struts = self._props(rib)
        return [(s, rib.facets[0 if "lower" in s.id else -1]) for s in struts]

    def _joints(self, rib: Rib) -> list[Joint]:
        """Facet to facet, upright to rib, foot to upright, struts between."""
        parts = self.system.outrigger
        two = {parts.corner.id: 2, parts.screw: 4, parts.t_nut: 4}
        pivot = pivot_bolts(parts.pivot, parts.screw, parts.t_nut)
        faces = pivot_bolts(parts.pivot, parts.screw, parts.t_nut, end=False)
        strip = {parts.screw: 4, parts.t_nut: 4}
        upright, foot, *_ = self._props(rib)
        bend = (rib.high_deg - rib.low_deg) / rib.count
        out = [
            Joint(bend_id(b), a.id, b.id, b.ends_mm[0], a.length_mm, bend, strip)
            for a, b in pairwise(rib.facets)
        ]
        nearest, pin = self._hinge(rib)
        level = float(pin[2] - upright.axis_mm[0, 2])
        out += [
            Joint(f"{rib.id} a", upright.id, nearest.id, pin, level, nearest.lean_deg, faces),
            Joint(
                f"{rib.id} b", foot.id, upright.id, upright.axis_mm[0], self._behind_mm, None, two
            ),
        ]
        for strut, facet in self._struts(rib):
            ends, along = strut.axis_mm, float(strut.axis_mm[0, 2] - upright.axis_mm[0, 2])
            out += [
                Joint(f"{strut.id} a", upright.id, strut.id, ends[0], along, None, two),
                Joint(f"{strut.id} b", strut.id, facet.id, ends[1], strut.length_mm,
                      facet.lean_deg, pivot),
            ]  # fmt: skip
        return out

    def _stays(self) -> Stays:
        """A sill on each foot and a stay for each upright, where the arc has them."""
        made = Stays()
        for rib in self.ribs if self.system.stays else ():
            upright, foot = self._props(rib)[:2]
            made += stayed(rib.id, [upright], [foot], self.system.outrigger.stay_parts)
        return made

    def _row(self) -> list[Rib]:
        return sorted(self.ribs, key=lambda rib: rib.turn_deg)

    def _base_bars(self) -> list[Member]:
        """Bars from upright to upright, over their feet."""
        out = []
        for k, (one, other) in enumerate(pairwise(self._row()), 1):
            profile = one.profile
            pins = [self._bar_pin(one, other)[2], self._bar_pin(other, one)[2]]
            along = (pins[1] - pins[0]) / np.linalg.norm(pins[1] - pins[0])
            # Cut to a whole millimetre; what is missing is in the pivots, half at each end.
            half = np.floor(np.linalg.norm(pins[1] - pins[0]) - 2.0 * self._arm_mm) / 2.0
            middle = (pins[0] + pins[1]) / 2.0
            axis = np.stack([middle - half * along, middle + half * along])
            size = (profile.width_mm, profile.height_mm)
            across = np.cross(Z, along)
            out.append(Member(f"base bar {k}", profile.id, "base bar", axis, across, size))
        return out

    def _bar_pin(self, rib: Rib, other: Rib) -> tuple[float, Floats, Floats]:
        """Height of a bar's pin over the floor, the face of the upright it is on, the pin (3,).

        On the face that looks most towards the other upright, over the bracket on the foot.
        """
        parts = self.system.outrigger
        foot, far = (self._props(r)[0].axis_mm[0] for r in (rib, other))
        normals = [sign * rib.axes[:, k] for k in (0, 1) for sign in (1.0, -1.0)]
        normal = max(normals, key=lambda n: float(n @ (far - foot)))
        depth = rib.profile.width_mm if abs(normal @ rib.axes[:, 0]) > 0.5 else (
            rib.profile.height_mm
        )  # fmt: skip
        width = (parts.pivot.size_mm or (20.0, 40.0, 20.0))[0]
        lift = rib.profile.height_mm + leg_mm(parts.corner)[0] + width / 2.0 + BESIDE_MM
        return lift, normal, foot + lift * Z + (depth / 2.0 + self._arm_mm) * normal

    def _base_joints(self, bars: list[Member]) -> list[Joint]:
        parts = self.system.outrigger
        pivot = pivot_bolts(parts.pivot, parts.screw, parts.t_nut)
        out = []
        for member, ribs in zip(bars, pairwise(self._row()), strict=True):
            for end, (mark, rib) in enumerate(zip("ab", ribs, strict=True)):
                lift, normal, pin = self._bar_pin(rib, ribs[1 - end])
                along = (member.axis_mm[1] - member.axis_mm[0]) / member.length_mm
                angle = float(np.degrees(np.arccos(np.clip(abs(along @ normal), 0.0, 1.0))))
                out.append(Joint(f"{member.id} {mark}", f"{rib.id} upright", member.id, pin, lift,
                                 angle, pivot))  # fmt: skip
        return out


def _whole_facets(radius_mm: float, half_rad: float) -> float:
    """The next radius on which facets of twice ``half_rad`` have whole millimetres."""
    return float(np.ceil(2.0 * radius_mm * np.sin(half_rad)) / (2.0 * np.sin(half_rad)))


def _far(one: Floats, other: Floats) -> float:
    return float(np.linalg.norm(one - other))
