"""How the structure of a mount stands in a plan file."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from annotated_types import Len
from pydantic import Field

from common.files.strict import Pair, StrictModel, Vector
from geometry.arrays import Floats
from rig.build.mounts.structure import (
    Hole,
    Joint,
    Member,
    PlacedPart,
    Plate,
    Solid,
    Structure,
    Wedge,
)

Row = Annotated[list[float], Len(4, 4)]
Transform = Annotated[list[Row], Len(4, 4)]


def table(values: Floats) -> list[list[float]]:
    """An array as lists."""
    return [[float(v) for v in row] for row in values]


class MemberModel(StrictModel):
    """A length of profile."""

    id: str
    part: str
    role: str
    length_mm: float
    axis_mm: list[Vector]
    across: Vector
    size_mm: Pair
    radius_mm: float | None
    note: str
    mitres_deg: Pair = Field(default_factory=lambda: [0.0, 0.0])

    @classmethod
    def of(cls, member: Member) -> Self:
        """The section that describes ``member``."""
        return cls(
            id=member.id,
            part=member.part,
            role=member.role,
            length_mm=member.length_mm,
            axis_mm=table(member.axis_mm),
            across=[float(v) for v in member.across],
            size_mm=list(member.size_mm),
            radius_mm=member.radius_mm,
            note=member.note,
            mitres_deg=list(member.mitres_deg),
        )

    def made(self) -> Member:
        """What it describes; the length follows from the axis."""
        return Member(
            self.id, self.part, self.role, np.array(self.axis_mm), np.array(self.across),
            (self.size_mm[0], self.size_mm[1]), self.radius_mm, self.note,
            (self.mitres_deg[0], self.mitres_deg[1]),
        )  # fmt: skip


class HoleModel(StrictModel):
    """A hole."""

    label: str
    x_mm: float
    y_mm: float
    diameter_mm: float
    kind: str
    thread: str

    def made(self) -> Hole:
        """What it describes."""
        return Hole(**dict(self))


def _holes(holes: tuple[Hole, ...]) -> list[HoleModel]:
    return [HoleModel.model_validate(vars(hole)) for hole in holes]


class PlateModel(StrictModel):
    """A plate."""

    id: str
    material: str
    thickness_mm: float
    rig_from_plate: Transform
    outline_mm: list[Pair]
    holes: list[HoleModel]
    cutouts_mm: list[list[Pair]]

    @classmethod
    def of(cls, plate: Plate) -> Self:
        """The section that describes ``plate``."""
        return cls(
            id=plate.id,
            material=plate.material,
            thickness_mm=plate.thickness_mm,
            rig_from_plate=table(plate.rig_from_plate),
            outline_mm=table(plate.outline_mm),
            holes=_holes(plate.holes),
            cutouts_mm=[table(cutout) for cutout in plate.cutouts_mm],
        )

    def made(self) -> Plate:
        """What it describes."""
        return Plate(
            self.id, self.material, self.thickness_mm, np.array(self.rig_from_plate),
            np.array(self.outline_mm), tuple(h.made() for h in self.holes),
            tuple(np.array(cutout) for cutout in self.cutouts_mm),
        )  # fmt: skip


class WedgeModel(StrictModel):
    """A printed wedge."""

    id: str
    camera: str
    rig_from_base: Transform
    base_from_seat: Transform
    seat_size_mm: Pair
    base_size_mm: Pair
    base_holes: list[HoleModel]
    screw: str
    screw_hole_mm: float

    @classmethod
    def of(cls, wedge: Wedge) -> Self:
        """The section that describes ``wedge``."""
        return cls(
            id=wedge.id,
            camera=wedge.camera,
            rig_from_base=table(wedge.rig_from_base),
            base_from_seat=table(wedge.base_from_seat),
            seat_size_mm=list(wedge.seat_size_mm),
            base_size_mm=list(wedge.base_size_mm),
            base_holes=_holes(wedge.base_holes),
            screw=wedge.screw,
            screw_hole_mm=wedge.screw_hole_mm,
        )

    def made(self) -> Wedge:
        """What it describes."""
        return Wedge(
            self.id, self.camera, np.array(self.rig_from_base), np.array(self.base_from_seat),
            (self.seat_size_mm[0], self.seat_size_mm[1]),
            (self.base_size_mm[0], self.base_size_mm[1]),
            tuple(h.made() for h in self.base_holes), self.screw, self.screw_hole_mm,
        )  # fmt: skip


class PartModel(StrictModel):
    """A bought part."""

    id: str
    part: str
    role: str
    rig_from_part: Transform
    camera: str
    joint: str = ""

    @classmethod
    def of(cls, placed: PlacedPart) -> Self:
        """The section that describes ``placed``."""
        return cls.model_validate(vars(placed) | {"rig_from_part": table(placed.rig_from_part)})

    def made(self) -> PlacedPart:
        """What it describes."""
        at = np.array(self.rig_from_part)
        return PlacedPart(self.id, self.part, self.role, at, self.camera, self.joint)


class JointModel(StrictModel):
    """A joint."""

    id: str
    on: str
    other: str
    point_mm: Vector
    along_mm: float | None
    angle_deg: float | None
    fasteners: dict[str, int]

    @classmethod
    def of(cls, joint: Joint) -> Self:
        """The section that describes ``joint``."""
        facts = {"point_mm": [float(v) for v in joint.point_mm], "fasteners": dict(joint.fasteners)}
        return cls.model_validate(vars(joint) | facts)

    def made(self) -> Joint:
        """What it describes."""
        return Joint(
            self.id, self.on, self.other, np.array(self.point_mm), self.along_mm, self.angle_deg,
            dict(self.fasteners),
        )  # fmt: skip


class SolidModel(StrictModel):
    """A convex solid."""

    owner: str
    kind: str
    corners_mm: list[Vector]

    @classmethod
    def of(cls, solid: Solid) -> Self:
        """The section that describes ``solid``."""
        return cls(owner=solid.owner, kind=solid.kind, corners_mm=table(solid.corners_mm))

    def made(self) -> Solid:
        """What it describes."""
        return Solid(self.owner, self.kind, np.array(self.corners_mm))


class StructureModel(StrictModel):
    """Everything that holds the cameras."""

    members: list[MemberModel]
    plates: list[PlateModel]
    wedges: list[WedgeModel]
    parts: list[PartModel]
    joints: list[JointModel]
    solids: list[SolidModel]

    @classmethod
    def of(cls, structure: Structure) -> Self:
        """The section that describes ``structure``."""
        return cls(
            members=[MemberModel.of(m) for m in structure.members],
            plates=[PlateModel.of(p) for p in structure.plates],
            wedges=[WedgeModel.of(w) for w in structure.wedges],
            parts=[PartModel.of(p) for p in structure.parts],
            joints=[JointModel.of(j) for j in structure.joints],
            solids=[SolidModel.of(s) for s in structure.solids],
        )

    def made(self) -> Structure:
        """What it describes."""
        return Structure(
            tuple(m.made() for m in self.members),
            tuple(p.made() for p in self.plates),
            tuple(w.made() for w in self.wedges),
            tuple(p.made() for p in self.parts),
            tuple(j.made() for j in self.joints),
            tuple(s.made() for s in self.solids),
        )
