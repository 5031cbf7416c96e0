"""What stands in a plan file: its pydantic models, and the way there and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

import numpy as np
from annotated_types import Len
from pydantic import Field

from geometry.arrays import Floats
from rig.designmodel import PlacedCamera
from rig.mounts.plan import Clash, Figures, Price, Tolerance
from rig.mounts.settings import Link, Motion, Setting, Tape
from rig.mounts.structure import (
    Hole,
    Joint,
    Member,
    PlacedPart,
    Plate,
    Solid,
    Structure,
    Wedge,
)
from rig.strict import Matrix, Pair, StrictModel, Vector

SCHEMA: Literal["rigwright.plan/1"] = "rigwright.plan/1"
Row = Annotated[list[float], Len(4, 4)]
Transform = Annotated[list[Row], Len(4, 4)]
Names = list[Annotated[str, Field(max_length=200)]]


def _table(values: Floats) -> list[list[float]]:
    return [[float(v) for v in row] for row in values]


class SettingModel(StrictModel):
    """One figure that a builder sets."""

    name: str
    unit: Literal["mm", "deg"]
    value: float
    step: float
    low: float
    high: float
    measured_from: str
    origin: float

    @classmethod
    def of(cls, setting: Setting) -> Self:
        """The section that describes ``setting``."""
        return cls.model_validate(vars(setting))

    def made(self) -> Setting:
        """What it describes."""
        return Setting(**dict(self))


class LinkModel(StrictModel):
    """One step of a chain."""

    transform: Transform
    motion: Literal["fixed", "slide", "turn"]
    axis: Vector | None
    setting: str
    per_unit: float

    @classmethod
    def of(cls, link: Link) -> Self:
        """The section that describes ``link``."""
        axis = None if link.axis is None else [float(v) for v in link.axis]
        return cls(
            transform=_table(link.transform),
            motion=link.motion.value,
            axis=axis,
            setting=link.setting,
            per_unit=link.per_unit,
        )

    def made(self) -> Link:
        """What it describes."""
        axis = None if self.axis is None else np.array(self.axis)
        motion = Motion(self.motion)
        return Link(np.array(self.transform), motion, axis, self.setting, self.per_unit)


class TapeModel(StrictModel):
    """A tape measure."""

    start: str
    end: str
    length_mm: float

    def made(self) -> Tape:
        """What it describes."""
        return Tape(**dict(self))


class WantedModel(StrictModel):
    """The pose of the design."""

    position_mm: Vector
    rotation_rig_to_camera: Matrix


class MountModel(StrictModel):
    """How one camera is held. Its pose is that of its settings."""

    camera: PlacedCamera
    wanted: WantedModel
    settings: list[SettingModel]
    chain: list[LinkModel]
    carried_by: Names
    tapes: list[TapeModel]


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

    @classmethod
    def of(cls, member: Member) -> Self:
        """The section that describes ``member``."""
        return cls(
            id=member.id,
            part=member.part,
            role=member.role,
            length_mm=member.length_mm,
            axis_mm=_table(member.axis_mm),
            across=[float(v) for v in member.across],
            size_mm=list(member.size_mm),
            radius_mm=member.radius_mm,
            note=member.note,
        )

    def made(self) -> Member:
        """What it describes; the length follows from the axis."""
        return Member(
            self.id, self.part, self.role, np.array(self.axis_mm), np.array(self.across),
            (self.size_mm[0], self.size_mm[1]), self.radius_mm, self.note,
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
            rig_from_plate=_table(plate.rig_from_plate),
            outline_mm=_table(plate.outline_mm),
            holes=_holes(plate.holes),
            cutouts_mm=[_table(cutout) for cutout in plate.cutouts_mm],
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
            rig_from_base=_table(wedge.rig_from_base),
            base_from_seat=_table(wedge.base_from_seat),
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

    @classmethod
    def of(cls, placed: PlacedPart) -> Self:
        """The section that describes ``placed``."""
        return cls.model_validate(vars(placed) | {"rig_from_part": _table(placed.rig_from_part)})

    def made(self) -> PlacedPart:
        """What it describes."""
        return PlacedPart(self.id, self.part, self.role, np.array(self.rig_from_part), self.camera)


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
        return cls(owner=solid.owner, kind=solid.kind, corners_mm=_table(solid.corners_mm))

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


class FiguresModel(StrictModel):
    """What a network of poses is worth."""

    sigma_median_mm: float
    sigma_p95_mm: float
    coverage_2_views: float
    coverage_3_views: float
    feasible: bool
    broken: list[str]

    @classmethod
    def of(cls, figures: Figures) -> Self:
        """The section that describes ``figures``."""
        return cls.model_validate(vars(figures) | {"broken": list(figures.broken)})

    def made(self) -> Figures:
        """What it describes."""
        facts: Mapping[str, object] = dict(self)
        return Figures(**{**facts, "broken": tuple(self.broken)})  # type: ignore[arg-type]


class PriceModel(StrictModel):
    """What building costs."""

    designed: FiguresModel
    rounded: FiguresModel
    built: FiguresModel
    sigma_loss: float
    coverage_loss: float

    @classmethod
    def of(cls, price: Price) -> Self:
        """The section that describes ``price``."""
        return cls(
            designed=FiguresModel.of(price.designed),
            rounded=FiguresModel.of(price.rounded),
            built=FiguresModel.of(price.built),
            sigma_loss=price.sigma_loss,
            coverage_loss=price.coverage_loss,
        )

    def made(self) -> Price:
        """What it describes; the losses follow."""
        return Price(self.designed.made(), self.rounded.made(), self.built.made())


class ToleranceModel(StrictModel):
    """A tolerance; None: no limit breaks within the range that was tried."""

    camera: str
    setting: str
    unit: Literal["mm", "deg"]
    plus: float | None
    minus: float | None
    limit: str

    @classmethod
    def of(cls, tolerance: Tolerance) -> Self:
        """The section that describes ``tolerance``."""
        ends = {
            end: value if np.isfinite(value) else None
            for end, value in (("plus", tolerance.plus), ("minus", tolerance.minus))
        }
        return cls.model_validate(vars(tolerance) | ends)

    def made(self) -> Tolerance:
        """What it describes."""
        plus = float("inf") if self.plus is None else self.plus
        minus = float("inf") if self.minus is None else self.minus
        return Tolerance(self.camera, self.setting, self.unit, plus, minus, self.limit)


class ClashModel(StrictModel):
    """A clash."""

    kind: str
    one: str
    other: str
    clearance_mm: float
    required_mm: float

    def made(self) -> Clash:
        """What it describes."""
        return Clash(**dict(self))


class PlanFile(StrictModel):
    """The root of a plan file."""

    schema_: Literal["rigwright.plan/1"] = Field(
        alias="schema", description='Version of the format: `"rigwright.plan/1"`.'
    )
    rigwright: str = Field(description="Version of the program that wrote it.")
    name: str = Field(description="Name of the rig.")
    system: str = Field(description="Kind of mount.")
    datum_rig_mm: Vector = Field(description="The datum, the foremost point of the subject.")
    mounts: list[MountModel] = Field(description="How each camera is held.")
    structure: StructureModel = Field(description="What holds the cameras.")
    price: PriceModel = Field(description="What building costs.")
    tolerances: list[ToleranceModel] = Field(description="How far each setting may be off.")
    clashes: list[ClashModel] = Field(description="What overlaps; empty for a sound plan.")
    yield_share: float | None = Field(description="Share of trial rigs that kept all limits.")
    yield_trials: int = Field(ge=0, description="How many were tried.")
    steps: list[str] = Field(description="The assembly steps.")
    notes: list[str] = Field(description="What else to know.")
