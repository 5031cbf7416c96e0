"""The ``[limits.*]`` sections: one table per limit, each with its own switch.

``enabled = false`` switches a limit off without deleting its numbers. A table that is not
there keeps the default of :class:`solver.limits.Limits`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Annotated, Self, TypeVar

from pydantic import Field, model_validator

from common.files.strict import StrictModel
from rig.specification.sections.plausible import (
    DistanceMm,
    GapMm,
    MovementMm,
    Pixels,
    Plausible,
    RangeDeg,
    RangeMm,
    Ratio,
    Share,
    TurnDeg,
    angle_deg,
    length_mm,
)
from rig.specification.sections.zones import ZonesSection
from solver.limits import (
    BaseHeight,
    Centring,
    Coverage,
    CoverageTier,
    Frame,
    Incidence,
    Limits,
    MotionBox,
    PoseBounds,
    Roll,
    Spacing,
    StandOff,
    Symmetry,
)

Plain = (
    PoseBounds
    | BaseHeight
    | Incidence
    | Frame
    | Centring
    | Spacing
    | Symmetry
    | StandOff
    | MotionBox
)
LimitT = TypeVar("LimitT")
OtherT = TypeVar("OtherT")
SwitchedT = TypeVar("SwitchedT", bound="Switched")


class Switched(StrictModel):
    """A limit with a switch."""

    enabled: bool = Field(
        default=True, description="`false` switches the limit off and keeps its numbers."
    )


def _limit(
    section: Switched | None, limit: Callable[..., LimitT], absent: OtherT, off: OtherT
) -> LimitT | OtherT:
    """A limit whose fields bear the names of the section's keys."""
    if section is None:
        return absent
    return limit(**section.model_dump(exclude={"enabled"})) if section.enabled else off


def _section(model: type[SwitchedT], limit: Plain | None) -> SwitchedT | None:
    """The inverse of :func:`_limit`."""
    return None if limit is None else model.model_validate(asdict(limit))


class BoundsSection(Switched):
    """Eq 8: how far each camera may move from its start, to either side."""

    omega_deg: RangeDeg | None = Field(
        default=None, description="Half range of omega; absent: free."
    )
    phi_deg: RangeDeg | None = Field(default=None, description="Half range of phi; absent: free.")
    kappa_deg: RangeDeg | None = Field(
        default=None, description="Half range of kappa; absent: free."
    )
    x_mm: RangeMm | None = Field(default=None, description="Half range of X; absent: free.")
    y_mm: RangeMm | None = Field(default=None, description="Half range of Y; absent: free.")
    z_mm: RangeMm | None = Field(default=None, description="Half range of Z; absent: free.")


class BaseHeightSection(Switched):
    """Eq 9: base/height ratio of camera pairs."""

    min: Ratio | None = Field(default=None, description="Least B/H of every pair.")
    max: Ratio | None = Field(default=None, description="Greatest B/H of every pair.")
    mean_min: Ratio | None = Field(default=None, description="Least mean B/H over all pairs.")
    mean_max: Ratio | None = Field(default=None, description="Greatest mean B/H over all pairs.")
    neighbour_max: Ratio | None = Field(
        default=None, description="Greatest B/H of each camera and its nearest neighbour."
    )


class IncidenceSection(Switched):
    """Eq 10: angle of incidence. The switch turns off the mean; ``ray_max_deg`` stays."""

    ray_max_deg: Annotated[float, angle_deg(2.0, 89.0, 70.0)] = Field(
        default=Incidence().ray_max_deg,
        description="A point counts as seen up to this angle between its normal and the ray. "
        "It says what a view is, so it holds even when the limit is switched off.",
    )
    mean_max_deg: Annotated[float, angle_deg(3.2, 180.0, 30.0)] | None = Field(
        default=None, description="Greatest mean angle of a camera's axis to the points' normals."
    )

    def to_limit(self) -> Incidence:
        """The limit; what counts as a view stays defined when the limit is off."""
        return Incidence(self.ray_max_deg, self.mean_max_deg if self.enabled else None)


class FrameSection(Switched):
    """Eq 11: every seen point lies inside the image. On when the table is absent."""

    margin_px: Pixels = Field(default=0.0, description="Distance to keep from the image border.")


class CentringSection(Switched):
    """Eq 12: the mean image coordinates of the seen points are zero."""

    tolerance_px: Pixels = Field(default=0.0, description="How far the mean may be off.")


class SpacingSection(Switched):
    """Eq 13: the mean Delaunay edge between cameras has a design length."""

    edge_mm: Annotated[float, length_mm(5.0, 1e6, 200.0)] = Field(description="The design length.")
    tolerance_mm: RangeMm = Field(default=0.0, description="How far the mean may be off.")


class SymmetrySection(Switched):
    """Eqs 14 and 15: symmetry of the camera positions about the object's centroid."""

    axes: str = Field(default="x", description='Axes it holds for, for example `"x"` or `"xz"`.')
    median_tolerance_mm: RangeMm | None = Field(
        default=None, description="Eq 14: mean and median agree within this; absent: off."
    )
    balance_tolerance_mm: RangeMm | None = Field(
        default=None, description="Eq 15: the mean is zero within this; absent: off."
    )

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if self.median_tolerance_mm is None and self.balance_tolerance_mm is None:
            raise ValueError("give median_tolerance_mm, balance_tolerance_mm or both")
        return self


class TierSection(StrictModel):
    """One step of the coverage."""

    views: int = Field(ge=1, le=500, description="Number of views.")
    share: Share = Field(description="Share of points that need them, 0 to 1.")


class CoverageSection(Switched):
    """How often points must be seen. The switch turns off the tiers."""

    unseen_sigma_mm: Annotated[float, length_mm(1e-4, 1e9, 1.0)] = Field(
        default=Coverage().unseen_sigma_mm,
        description="Standard deviation of a point before anybody looks: what losing it costs.",
    )
    tier: list[TierSection] = Field(default_factory=list, description="The steps.")

    def to_limit(self) -> Coverage:
        """The limit; the price of an unseen point stays when the tiers are off."""
        tiers = self.tier if self.enabled else []
        return Coverage(tuple(CoverageTier(t.views, t.share) for t in tiers), self.unseen_sigma_mm)

    @classmethod
    def from_limit(cls, limit: Coverage) -> Self:
        """The section that describes ``limit``."""
        tiers = [TierSection(views=t.views, share=t.share) for t in limit.tiers]
        return cls(unseen_sigma_mm=limit.unseen_sigma_mm, tier=tiers)


class DepthOfFieldSection(Switched):
    """Every seen point is sharp. On when the table is absent."""


class GsdSection(Switched):
    """Ground sample distance: the size of a pixel on the object."""

    max_mm: Annotated[float, length_mm(5e-4, 100.0, 0.1)] = Field(
        description="Largest pixel on the object."
    )


class StandOffSection(Switched):
    """Distance of each projection centre from the object's centroid."""

    min_mm: DistanceMm | None = Field(default=None, description="Least distance.")
    max_mm: DistanceMm | None = Field(default=None, description="Greatest distance.")


class BodiesSection(Switched):
    """Camera bodies do not touch. On when the table is absent."""

    clearance_mm: GapMm = Field(default=0.0, description="Gap to keep between bodies.")


class SightLinesSection(Switched):
    """No body stands in another camera's view. On when the table is absent."""

    clearance_mm: GapMm = Field(default=0.0, description="Gap to keep between body and view.")


def _clearance(
    section: BodiesSection | SightLinesSection | None, absent: float | None
) -> float | None:
    if section is None:
        return absent
    return section.clearance_mm if section.enabled else None


class MotionSection(Switched):
    """Head movement for which the design must hold, to either side."""

    x_mm: MovementMm = Field(default=0.0, description="Sideways.")
    y_mm: MovementMm = Field(default=0.0, description="Towards and away from the cameras.")
    z_mm: MovementMm = Field(default=0.0, description="Up and down.")
    pitch_deg: TurnDeg = Field(default=0.0, description="Turn about X (nodding).")
    roll_deg: TurnDeg = Field(default=0.0, description="Turn about Y (tilting).")
    yaw_deg: TurnDeg = Field(default=0.0, description="Turn about Z (shaking).")


class LimitsSection(StrictModel):
    """Everything the rig must respect."""

    image_sigma_px: Annotated[float, Plausible(1e-3, 100.0, 0.5, "pixels")] = Field(
        default=Limits().image_sigma_px,
        description="Standard deviation of an image measurement.",
    )
    bounds: BoundsSection | None = Field(default=None, description="Eq 8, bounds about the start.")
    base_height: BaseHeightSection | None = Field(default=None, description="Eq 9, base/height.")
    incidence: IncidenceSection | None = Field(default=None, description="Eq 10, incidence.")
    frame: FrameSection | None = Field(default=None, description="Eq 11, in frame.")
    centring: CentringSection | None = Field(default=None, description="Eq 12, centred images.")
    spacing: SpacingSection | None = Field(default=None, description="Eq 13, camera spacing.")
    symmetry: SymmetrySection | None = Field(default=None, description="Eqs 14 and 15, symmetry.")
    coverage: CoverageSection | None = Field(default=None, description="Views per point.")
    depth_of_field: DepthOfFieldSection | None = Field(default=None, description="Sharpness.")
    gsd: GsdSection | None = Field(default=None, description="Pixel size on the object.")
    roll: Roll = Field(
        default=Limits().roll,
        strict=False,
        description='How pictures may be turned: `"level"`, upright to the head; `"portrait"`, a '
        'quarter turn to either side; `"level-or-portrait"`, for each camera the one that lets it '
        'stand closer; `"free"`.',
    )
    stand_off: StandOffSection | None = Field(default=None, description="Distance to the object.")
    bodies: BodiesSection | None = Field(default=None, description="Gap between bodies.")
    sight_lines: SightLinesSection | None = Field(default=None, description="Free views.")
    zones: ZonesSection | None = Field(default=None, description="Where cameras may stand.")
    motion: MotionSection | None = Field(default=None, description="Head movement.")

    def to_limits(self) -> Limits:
        """The limits as the solver sees them."""
        default = Limits()
        gsd, bodies, sight = self.gsd, self.bodies, self.sight_lines
        return Limits(
            image_sigma_px=self.image_sigma_px,
            bounds=_limit(self.bounds, PoseBounds, None, None),
            base_height=_limit(self.base_height, BaseHeight, BaseHeight(), BaseHeight()),
            incidence=(self.incidence or IncidenceSection()).to_limit(),
            frame=_limit(self.frame, Frame, default.frame, None),
            centring=_limit(self.centring, Centring, None, None),
            spacing=_limit(self.spacing, Spacing, None, None),
            symmetry=_limit(self.symmetry, Symmetry, None, None),
            coverage=(self.coverage or CoverageSection()).to_limit(),
            depth_of_field=default.depth_of_field
            if self.depth_of_field is None
            else self.depth_of_field.enabled,
            gsd_max_mm=gsd.max_mm if gsd is not None and gsd.enabled else None,
            roll=self.roll,
            stand_off=_limit(self.stand_off, StandOff, StandOff(), StandOff()),
            body_clearance_mm=_clearance(bodies, default.body_clearance_mm),
            sight_line_clearance_mm=_clearance(sight, default.sight_line_clearance_mm),
            zones=self.zones.to_zones() if self.zones is not None else default.zones,
            motion=_limit(self.motion, MotionBox, None, None),
        )

    @classmethod
    def from_limits(cls, limits: Limits) -> Self:
        """The section that describes ``limits``; what is off by choice says so."""
        gsd, body, sight = (
            limits.gsd_max_mm,
            limits.body_clearance_mm,
            limits.sight_line_clearance_mm,
        )
        return cls(
            image_sigma_px=limits.image_sigma_px,
            bounds=_section(BoundsSection, limits.bounds),
            base_height=_section(BaseHeightSection, limits.base_height),
            incidence=_section(IncidenceSection, limits.incidence),
            frame=_section(FrameSection, limits.frame) or FrameSection(enabled=False),
            centring=_section(CentringSection, limits.centring),
            spacing=_section(SpacingSection, limits.spacing),
            symmetry=_section(SymmetrySection, limits.symmetry),
            coverage=CoverageSection.from_limit(limits.coverage),
            depth_of_field=DepthOfFieldSection(enabled=limits.depth_of_field),
            gsd=None if gsd is None else GsdSection(max_mm=gsd),
            roll=limits.roll,
            stand_off=_section(StandOffSection, limits.stand_off),
            bodies=BodiesSection(enabled=body is not None, clearance_mm=body or 0.0),
            sight_lines=SightLinesSection(enabled=sight is not None, clearance_mm=sight or 0.0),
            zones=ZonesSection.from_zones(limits.zones),
            motion=_section(MotionSection, limits.motion),
        )
