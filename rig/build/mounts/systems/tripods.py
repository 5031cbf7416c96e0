"""Tripods: a stand on the floor for each camera, a column set to a height, a head on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.build.mounts.clashes import Site, pairs
from rig.build.mounts.kinematics import frames_along, reach, rotated, standing
from rig.build.mounts.settings import (
    CameraMount,
    Link,
    Motion,
    Setting,
    Tape,
    chain_pose,
    shift,
    turn,
)
from rig.build.mounts.solids import bar, camera_solids, lens_front
from rig.build.mounts.structure import Joint, PlacedPart, Solid, Structure
from rig.build.mounts.surroundings import Surroundings
from rig.build.mounts.systems.base import Built, Spread
from rig.build.mounts.systems.heads import HeadKind, Stance, head_id, stances
from rig.build.mounts.systems.threads import counted, height_mm
from rig.catalogue.items import Bracket, Fastener

X, Y, Z = np.eye(3)
COLUMN_MM = 30.0
LEG_MM = 25.0
LEG_TOP_SHARE = 0.8
"""Where the legs meet the column, as a share of the lowest height of the head's foot."""

LEG_TURNS_DEG = tuple(float(a) for a in range(0, 120, 15))
LEVEL = "level"
ANGLE_MM = 15.0
ANGLE_PLATE = "angle-plate-head"
FEET = (
    (LEVEL, np.eye(3)),
    ("right", standing(X, Y)),
    ("left", standing(-X, Y)),
)
"""A head stands on its column, or lies to one side on an angle plate: for cameras rolled far."""

FARTHEST_MM = 5000.0
ROOM_MM = 14.0


@dataclass(frozen=True, eq=False)
class Stood:
    """One camera on its tripod; the legs are turned by ``legs_deg``."""

    mount: CameraMount
    legs_deg: float
    stand: Bracket
    head: HeadKind
    foot_name: str = LEVEL

    @property
    def stand_id(self) -> str:
        """Id of the tripod."""
        return f"{self.mount.name} tripod"

    def foot(self) -> Floats:
        """The tripod's place on the floor (4, 4)."""
        at = frames_along(self.mount.chain, self.mount.values())[2].copy()
        return np.asarray(at)

    def top(self) -> Floats:
        """The head's foot (4, 4)."""
        at = frames_along(self.mount.chain, self.mount.values())[3]
        return np.asarray(at @ shift(-self.head.pivot_mm * Z))

    def column_top(self) -> Floats:
        """The top of the column, (3,)."""
        return np.asarray(self.foot()[:3, 3] + self.mount.values()["column"] * Z)

    def solids(self) -> tuple[Solid, ...]:
        """Column, legs and head."""
        foot, top = self.foot()[:3, 3], self.column_top()
        out = [bar(self.stand_id, "member", foot + 50.0 * Z, top, X, (COLUMN_MM, COLUMN_MM))]
        hip = foot + LEG_TOP_SHARE * lowest_mm(self.stand) * Z
        radius = _size(self.stand)[0] / 2.0
        for leg in range(3):
            away = turn(Z, self.legs_deg + 120.0 * leg) @ X
            side = np.cross(Z, away)
            out.append(
                bar(self.stand_id, "member", hip, foot + radius * away + LEG_MM * Z, side,
                    (LEG_MM, LEG_MM))
            )  # fmt: skip
        return (*out, *self.head.solids(self.mount))

    def placed(self) -> tuple[PlacedPart, ...]:
        """Tripod and head."""
        at = self.foot() @ rotated(turn(Z, self.legs_deg))
        name = self.mount.name
        stand = PlacedPart(self.stand_id, self.stand.id, "tripod", at, name)
        head = PlacedPart(head_id(name), self.head.part.id, "head", self.top(), name)
        if self.foot_name == LEVEL:
            return stand, head
        plate = PlacedPart(
            f"{name} angle plate", ANGLE_PLATE, "angle plate", shift(self.column_top()), name
        )
        return stand, plate, head

    def joints(self, adapter: Fastener | None) -> tuple[Joint, ...]:
        """Part on part, with an ``adapter`` under the head, and the camera on its head."""
        name, placed = self.mount.name, self.placed()
        head = placed[-1]
        held = [
            Joint(f"{name} {mark}", a.id, b.id, b.rig_from_part[:3, 3], None, None,
                  counted(adapter) if b is head else {})
            for mark, (a, b) in zip("ab", pairwise(placed), strict=False)
        ]  # fmt: skip
        seat = self.mount.camera.pose.to_rig(
            self.mount.camera.camera.body.mount_thread_camera_mm[None]
        )[0]
        between = counted(self.head.camera_adapter(self.mount.camera))
        return (*held, Joint(f"{name} c", head.id, name, seat, None, None, between))

    def touching(self) -> tuple[tuple[str, str], ...]:
        """Pairs of owners that touch by intent."""
        head = head_id(self.mount.name)
        return ((self.stand_id, head), (head, self.mount.name))


def _size(stand: Bracket) -> tuple[float, float, float]:
    """Circle of the feet, and lowest and greatest height of the column's top."""
    if stand.size_mm is None:
        raise InputError(
            "mount-part", f"the catalogue does not say the size of {stand.id}", "add its size_mm"
        )
    return stand.size_mm


def lowest_mm(stand: Bracket) -> float:
    """Lowest height of the column's top."""
    return 0.4 * _size(stand)[1]


@dataclass(frozen=True, eq=False)
class TripodSystem:
    """A tripod for each camera."""

    stand: Bracket
    head: HeadKind
    adapter: Fastener | None
    floor_step_mm: float
    column_step_mm: float
    kind: str = "tripods"

    @property
    def steps(self) -> tuple[float, float]:
        """The coarser of the steps on the floor and on the column, and the head's."""
        return max(self.floor_step_mm, self.column_step_mm), self.head.step_deg

    def hold(self, cameras: tuple[RigCamera, ...], around: Surroundings) -> TripodHolding:
        """See :class:`rig.build.mounts.systems.base.MountSystem`."""
        everyone = (*cameras, *around.standing)
        solids = tuple(s for camera in everyone for s in camera_solids(camera))
        site = Site(solids, everyone, around, ROOM_MM)
        stood = []
        for camera in cameras:
            best: tuple[int, Stood] | None = None
            for option in self._options(camera, around):
                count = site.clashes(option.solids(), pairs(*option.touching()))
                if best is None or count < best[0]:
                    best = (count, option)
                if count == 0:
                    break
            if best is None:
                raise self._out_of_height(camera, around)
            site.add(best[1].solids())
            stood.append(best[1])
        return TripodHolding(self, tuple(stood), around)

    def _out_of_height(self, camera: RigCamera, around: Surroundings) -> InputError:
        height = float(camera.pose.position_rig_mm[2]) - around.floor_z_mm
        low, high = lowest_mm(self.stand), _size(self.stand)[1]
        return InputError(
            "tripod-height",
            f"tripod {self.stand.id} cannot hold {camera.name} {height:.0f} mm over the floor",
            f"it holds heads from {low:.0f} to {high:.0f} mm: choose another stand or floor_z_mm",
        )

    def _options(self, camera: RigCamera, around: Surroundings) -> Iterator[Stood]:
        for stance in stances(self.head, camera, FEET):
            mount = self._mount(camera, stance, around)
            if mount is not None:
                for legs in LEG_TURNS_DEG:
                    yield Stood(mount, legs, self.stand, self.head, stance.foot)

    def _mount(
        self, camera: RigCamera, stance: Stance[str], around: Surroundings
    ) -> CameraMount | None:
        floor = np.array([around.datum_mm[0], around.datum_mm[1], around.floor_z_mm])
        chain = (
            Link(shift(floor), Motion.SLIDE, X, "across"),
            Link(np.eye(4), Motion.SLIDE, -Y, "back"),
            Link(np.eye(4), Motion.SLIDE, Z, "column"),
            *self.head.links(self._top(stance.foot), camera),
        )
        settings = (*self._slides(), *self.head.settings(stance.angles_deg))
        values = {s.name: s.value for s in settings}
        found = reach(chain, values, ["across", "back", "column"], stance.pose)
        if any(not s.low <= found[s.name] <= s.high for s in settings):
            return None
        placed = camera.moved_to(chain_pose(chain, found))
        moved = tuple(replace(s, value=found[s.name]) for s in settings)
        return CameraMount(placed, camera.pose, moved, chain)

    def _top(self, foot: str) -> Floats:
        """The head's foot (4, 4) from the top of the column."""
        rotation = dict(FEET)[foot]
        lift = height_mm(self.adapter)
        if foot == LEVEL:
            return rotated(rotation, lift * Z)
        # On the angle plate the head lies beside the column's line, clear of its top.
        return rotated(
            rotation, (ANGLE_MM + lift) * rotation[:, 2] + (self.head.width_mm / 2.0 + 20.0) * Z
        )

    def _slides(self) -> tuple[Setting, ...]:
        mark = "the plumb point of the datum on the floor to the middle of the column"
        low, high = lowest_mm(self.stand), _size(self.stand)[1]
        return (
            Setting("across", "mm", 0.0, self.floor_step_mm, -FARTHEST_MM, FARTHEST_MM,
                    f"{mark}, positive to the subject's left"),
            Setting("back", "mm", 0.0, self.floor_step_mm, -FARTHEST_MM, FARTHEST_MM,
                    f"{mark}, positive away from the subject"),
            Setting("column", "mm", low, self.column_step_mm, low, high,
                    "the floor to the top of the column"),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class TripodHolding:
    """Cameras on their tripods."""

    system: TripodSystem
    stood: tuple[Stood, ...]
    around: Surroundings

    @property
    def mounts(self) -> tuple[CameraMount, ...]:
        """In the order of the cameras."""
        return tuple(s.mount for s in self.stood)

    def with_mounts(self, mounts: tuple[CameraMount, ...]) -> Self:
        """The same tripods set anew."""
        stood = tuple(replace(s, mount=m) for s, m in zip(self.stood, mounts, strict=True))
        return replace(self, stood=stood)

    def with_stays(self) -> Self:
        """A tripod needs none."""
        return self

    def with_spread(self, spread: Spread) -> Self:  # noqa: ARG002
        """A tripod has legs of its own."""
        return self

    def build(self) -> Built:
        """See :class:`rig.build.mounts.systems.base.Holding`."""
        solids = tuple(
            s for stood in self.stood for s in (*stood.solids(), *camera_solids(stood.mount.camera))
        )
        joints = tuple(j for s in self.stood for j in s.joints(self.system.adapter))
        parts = tuple(p for s in self.stood for p in s.placed())
        touching = [pair for s in self.stood for pair in s.touching()]
        structure = Structure((), (), (), parts, joints, solids)
        mounts = tuple(self._measured(s) for s in self.stood)
        notes = ("All heads look along the subject's line of sight at pan 0: set them by a line "
                 "on the floor that is square to the subject.",)  # fmt: skip
        return Built(structure, mounts, pairs(*touching), notes)

    def _measured(self, stood: Stood) -> CameraMount:
        front, name = lens_front(stood.mount.camera), stood.mount.name
        datum = self.around.datum_mm
        plumb = np.array([datum[0], datum[1], self.around.floor_z_mm])
        tapes = (
            Tape("datum", f"lens front of {name}", float(np.linalg.norm(front - datum))),
            Tape("plumb point of the datum on the floor", f"lens front of {name}",
                 float(np.linalg.norm(front - plumb))),
        )  # fmt: skip
        carried_by = tuple(p.id for p in stood.placed())
        return replace(stood.mount, carried_by=carried_by, tapes=tapes)
