"""A stub bar across a rail, an arm along the stub towards the subject, a head on the arm.

The frame of the rail where the stub sits: x across (to the right seen from behind the
cameras), y towards the subject, z along the rail. The stub lies on the rail's front face, the
arm crosses over or under the stub, the head stands on one of the arm's four faces. The
plate under the head may be pitched on a pivot joint, where a head alone cannot look so steeply.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from geometry.camera import RigCamera
from rig.build.mounts.kinematics import frames_along, rotated, standing
from rig.build.mounts.settings import CameraMount, Link, Motion, Setting, shift, turn
from rig.build.mounts.solids import bar, box, carried
from rig.build.mounts.structure import Joint, Member, PlacedPart, Solid
from rig.build.mounts.systems.corners import leg_mm
from rig.build.mounts.systems.heads import HeadKind, head_id
from rig.build.mounts.systems.levelling import Levelling
from rig.build.mounts.systems.pivots import pivot_arm_mm, pivot_part
from rig.build.mounts.systems.stays import StayParts
from rig.build.mounts.systems.threads import counted, height_mm
from rig.catalogue.items import Bracket, Fastener, Profile

X, Y, Z = np.eye(3)
FACES: tuple[tuple[str, Floats], ...] = (("top", Z), ("under", -Z), ("right", X), ("left", -X))
PITCHES_DEG = (0.0, 30.0, -30.0, 60.0, -60.0)
SHORTEST_ARM_MM = 10.0
LONGEST_ARM_MM = 900.0
LONGEST_STUB_MM = 400.0
STUB_END_MM = 5.0
"""How far a stub reaches past the last bracket on it."""

SET_ROOM_MM = 4.0
"""From the rear end of an arm to its rail: so much less the reach can be set, which it is where a
frame leans forward under its weight. A millimetre more leaves the nuts of its brackets, on the
middle line of the stub, the 5 mm of the arm that they need."""


@dataclass(frozen=True, eq=False)
class HeadFooting:
    """Where a head stands: the face of the arm, and how far its plate is pitched up."""

    name: str
    face: Floats
    pitch_deg: float

    def rotation(self) -> Floats:
        """The head's foot in the rail's frame, (3, 3)."""
        return np.asarray(standing(self.face, Y) @ turn(X, self.pitch_deg))


FOOTINGS = tuple(
    HeadFooting(name if pitch == 0.0 else f"{name} {pitch:+g} degree", face, pitch)
    for pitch in PITCHES_DEG
    for name, face in FACES
)
"""All ways to put a head on an arm, level plates first."""


@dataclass(frozen=True, eq=False)
class Outrigger:
    """Sizes of the parts that carry one camera; ``side`` 1: the arm lies over the stub.

    ``levelling``: what the frame of the same profile stands on; None: on the floor.
    """

    profile: Profile
    plate: Bracket
    corner: Bracket
    pivot: Bracket
    t_nut: str
    screw: str
    head: HeadKind
    adapter: Fastener | None = None
    levelling: Levelling | None = None

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width across and height of the profile as it lies: in x and z."""
        return self.profile.width_mm, self.profile.height_mm

    @property
    def plate_mm(self) -> tuple[float, float, float]:
        """Width, length and thickness of the plate under the head."""
        width, length, thick = self.plate.size_mm or (40.0, 60.0, 5.0)
        return width, length, thick

    @property
    def stay_parts(self) -> StayParts:
        """What back-stays of the same profile are made of."""
        return StayParts(self.profile, self.corner, self.pivot, self.screw, self.t_nut)

    def stub_y_mm(self, rail_depth_mm: float) -> float:
        """Middle of the stub before the middle of the rail."""
        return (rail_depth_mm + self.profile.width_mm) / 2.0

    def base(self, foot: HeadFooting) -> Floats:
        """The head's foot (4, 4) from the front end of the arm's middle line."""
        _, length, thick = self.plate_mm
        arm = 0.0 if foot.pitch_deg == 0.0 else pivot_arm_mm(self.pivot)
        under = (self._half_along(foot.face) + arm) * foot.face - length / 2.0 * Y
        rotation = foot.rotation()
        return rotated(rotation, under + (arm + thick + height_mm(self.adapter)) * rotation[:, 2])

    def _half_along(self, face: Floats) -> float:
        width, height = self.size_mm
        return width / 2.0 if abs(face[0]) > 0.5 else height / 2.0

    def arm_from_stub(self, side: int) -> Floats:
        """The stub's middle to the arm's middle line at the stub's front face, (4, 4)."""
        return shift(np.array([0.0, self.profile.width_mm / 2.0, side * self.profile.height_mm]))

    def links(
        self, rail_depth_mm: float, side: int, foot: HeadFooting, camera: RigCamera
    ) -> tuple[Link, ...]:
        """From the rail's frame, where the stub's middle is at z = 0, to the camera."""
        return (
            Link(shift(self.stub_y_mm(rail_depth_mm) * Y), Motion.SLIDE, X, "across"),
            Link(self.arm_from_stub(side), Motion.SLIDE, Y, "reach"),
            *self.head.links(self.base(foot), camera),
        )

    def settings(self, angles_deg: Floats, step_mm: float, rail: str) -> tuple[Setting, ...]:
        """Across and reach at 0, and the head's angles."""
        across = Setting(
            "across", "mm", 0.0, step_mm, -LONGEST_STUB_MM, LONGEST_STUB_MM,
            f"the middle slot of {rail} to the middle slot of the arm, right positive seen from "
            "behind",
        )  # fmt: skip
        reach = Setting(
            "reach", "mm", 100.0, step_mm, SHORTEST_ARM_MM, LONGEST_ARM_MM,
            "the front face of the stub to the front end of the arm",
        )  # fmt: skip
        return (across, reach, *self.head.settings(angles_deg))


@dataclass(frozen=True, eq=False)
class Hung:
    """One camera's outrigger in its place: ``rig_from_rail`` (4, 4) where its stub sits."""

    mount: CameraMount
    rail: str
    rig_from_rail: Floats
    rail_size_mm: tuple[float, float]
    side: int
    foot: HeadFooting
    parts: Outrigger

    @property
    def stub_id(self) -> str:
        """Id of the stub."""
        return f"{self.mount.name} stub"

    @property
    def arm_id(self) -> str:
        """Id of the arm."""
        return f"{self.mount.name} arm"

    def arm_front(self) -> Floats:
        """Frame (4, 4) of the front end of the arm's middle line, y along the arm."""
        frames = frames_along(self.mount.chain, self.mount.values())
        return np.asarray(frames[-5] @ np.linalg.inv(self.mount.chain[-4].transform))

    def members(self) -> tuple[Member, Member]:
        """Stub and arm, cut to whole millimetres."""
        values, part = self.mount.values(), self.parts.profile
        at, front = self.rig_from_rail, self.arm_front()
        stub_y = self.parts.stub_y_mm(self.rail_size_mm[1])
        half_rail, half_arm = self.rail_size_mm[0] / 2.0, part.width_mm / 2.0
        past = leg_mm(self.parts.corner)[0] + STUB_END_MM
        ends = (
            min(-half_rail, values["across"] - half_arm) - past,
            max(half_rail, values["across"] + half_arm) + past,
        )
        low = float(np.floor(ends[0]))
        stub_axis = np.array([[low, stub_y, 0.0], [low + np.ceil(ends[1] - low), stub_y, 0.0]])
        # Off the rail behind the stub, by no more than rounding up leaves of it.
        length = np.ceil(values["reach"] + part.width_mm - SET_ROOM_MM - 1e-6)
        end = front[:3, 3]
        arm_axis = np.array([end - length * front[:3, 1], end])
        size = (part.width_mm, part.height_mm)
        return (
            Member(self.stub_id, part.id, "stub", carried(at, stub_axis), at[:3, 1], size),
            Member(self.arm_id, part.id, "arm", arm_axis, front[:3, 0], size),
        )

    def placed(self) -> tuple[PlacedPart, ...]:
        """Plate and head, and the pivot under a plate that is pitched."""
        foot = self.arm_front() @ self.parts.base(self.foot)
        under = self.parts.plate_mm[2] + height_mm(self.parts.adapter)
        plate = foot @ shift(np.array([0.0, 0.0, -under]))
        name = self.mount.name
        return (
            PlacedPart(f"{name} plate", self.parts.plate.id, "head plate", plate, name),
            PlacedPart(head_id(name), self.parts.head.part.id, "head", foot, name),
            *(part for part, _ in self._pivot(plate)),
        )

    def _pivot(self, plate: Floats) -> list[tuple[PlacedPart, tuple[Solid, Solid]]]:
        """The pivot between arm and plate ``plate`` (4, 4), where there is one."""
        if self.foot.pitch_deg == 0.0:
            return []
        up, pin = plate[:3, 2], plate[:3, 0]
        down = -self.arm_front()[:3, :3] @ self.foot.face
        at = plate[:3, 3] - pivot_arm_mm(self.parts.pivot) * up
        joint = Joint(f"{self.mount.name} c", self.arm_id, f"{self.mount.name} plate", at)
        return [pivot_part(joint, self.parts.pivot, at, pin, (down, up), self.mount.name)]

    def solids(self) -> tuple[Solid, ...]:
        """Stub, arm, plate and head."""
        stub, arm = self.members()
        plate = self.placed()[0]
        width, length, thick = self.parts.plate_mm
        half = np.array([width / 2.0, length / 2.0, 0.0])
        return (
            bar(stub.id, "member", stub.axis_mm[0], stub.axis_mm[1], stub.across, stub.size_mm),
            bar(arm.id, "member", arm.axis_mm[0], arm.axis_mm[1], arm.across, arm.size_mm),
            box(
                plate.id, "bracket", plate.rig_from_part, -half, half + np.array([0.0, 0.0, thick])
            ),
            *(solid for _, halves in self._pivot(plate.rig_from_part) for solid in halves),
            *self.parts.head.solids(self.mount),
        )

    def joints(self, rail_along_mm: float) -> tuple[Joint, ...]:
        """Stub on rail, arm on stub, plate on arm, head on plate, camera on head."""
        stub, arm = self.members()
        plate, head, *pivot = self.placed()
        bolts = {self.parts.screw: 2, self.parts.t_nut: 2}
        two = {self.parts.corner.id: 2, self.parts.screw: 4, self.parts.t_nut: 4}
        pitch = self.foot.pitch_deg
        if pitch != 0.0:
            bolts = {self.parts.screw: 4, self.parts.t_nut: 4}
        on_rail = self.rig_from_rail[:3, 3]
        across = self.mount.values()["across"]
        middle = on_rail + self.rig_from_rail[:3, :3] @ np.array(
            [across, self.parts.stub_y_mm(self.rail_size_mm[1]), 0.0]
        )
        along = float((middle - stub.axis_mm[0]) @ self.rig_from_rail[:3, 0])
        name, seat = self.mount.name, self.mount.camera.pose.to_rig(
            self.mount.camera.camera.body.mount_thread_camera_mm[None]
        )[0]  # fmt: skip
        return (
            Joint(f"{name} a", self.rail, stub.id, on_rail, rail_along_mm, None, two),
            Joint(f"{name} b", stub.id, arm.id, middle, along, None, two),
            Joint(
                f"{name} c", arm.id, plate.id, (pivot[0] if pivot else plate).rig_from_part[:3, 3],
                arm.length_mm - self.parts.plate_mm[1] / 2.0, pitch or None, bolts,
            ),
            Joint(f"{name} d", plate.id, head.id, head.rig_from_part[:3, 3], None, None,
                  counted(self.parts.adapter)),
            Joint(f"{name} e", head.id, name, seat, None, None,
                  counted(self.parts.head.camera_adapter(self.mount.camera))),
        )  # fmt: skip

    def touching(self) -> tuple[tuple[str, str], ...]:
        """Pairs of owners that touch by intent."""
        name, plate, head = self.mount.name, f"{self.mount.name} plate", head_id(self.mount.name)
        pivot = f"{name} c pivot"
        return (
            (self.arm_id, pivot), (plate, pivot),
            (self.rail, self.stub_id), (self.rail, self.arm_id), (self.stub_id, self.arm_id),
            (self.arm_id, plate), (plate, head), (self.arm_id, head), (head, name), (plate, name),
        )  # fmt: skip
