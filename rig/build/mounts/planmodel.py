"""What stands in a plan file: its pydantic models, and the way there and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field

from common.files.strict import Matrix, StrictModel, Vector
from rig.build.mounts.plan import Clash, Figures, Give, Price, Sag, Stance, Tolerance
from rig.build.mounts.settings import Link, Motion, Setting, Tape
from rig.build.mounts.structuremodel import StructureModel, Transform, table
from rig.design.designmodel import PlacedCamera

SCHEMA: Literal["rigwright.plan/1"] = "rigwright.plan/1"
Names = list[Annotated[str, Field(max_length=200)]]


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
            transform=table(link.transform),
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


class GiveModel(StrictModel):
    """The sag as the error of one setting; None: no limit breaks."""

    setting: str
    unit: Literal["mm", "deg"]
    off: float
    allowed: float | None
    step: float

    def made(self) -> Give:
        """What it describes."""
        allowed = float("inf") if self.allowed is None else self.allowed
        return Give(self.setting, self.unit, self.off, allowed, self.step)


class SagModel(StrictModel):
    """How a camera gives way."""

    camera: str
    shift_mm: Vector
    lean_deg: float
    touched_mm: float
    touched_deg: float
    gives: list[GiveModel]

    @classmethod
    def of(cls, sag: Sag) -> Self:
        """The section that describes ``sag``."""
        gives = [
            GiveModel.model_validate(
                vars(give) | {"allowed": give.allowed if np.isfinite(give.allowed) else None}
            )
            for give in sag.gives
        ]
        facts = {"shift_mm": [float(v) for v in sag.shift_mm], "gives": gives}
        return cls.model_validate(vars(sag) | facts)

    def made(self) -> Sag:
        """What it describes."""
        gives = tuple(give.made() for give in self.gives)
        return Sag(
            self.camera, np.array(self.shift_mm), self.lean_deg, self.touched_mm,
            self.touched_deg, gives,
        )  # fmt: skip


class StanceModel(StrictModel):
    """How something that stands by itself resists tipping."""

    on: list[str]
    mass_kg: float
    centre_mm: Vector
    height_mm: float
    push_n: float
    tips_n: float
    toward: str
    way: list[float] = Field(min_length=2, max_length=2)

    @classmethod
    def of(cls, stance: Stance) -> Self:
        """The section that describes ``stance``."""
        facts = {
            "on": list(stance.on),
            "centre_mm": [float(v) for v in stance.centre_mm],
            "way": [float(v) for v in stance.way],
        }
        return cls.model_validate(vars(stance) | facts)

    def made(self) -> Stance:
        """What it describes."""
        facts = {"on": tuple(self.on), "centre_mm": np.array(self.centre_mm)}
        return Stance(**(vars(self) | facts | {"way": np.array(self.way)}))


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
    sags: list[SagModel] = Field(
        default_factory=list, description="How each camera gives way under the rig's own weight."
    )
    stances: list[StanceModel] = Field(
        default_factory=list, description="How what stands by itself resists tipping."
    )
