"""The ``[matching]`` section: what a dense matcher can use."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Self

from pydantic import Field

from common.files.strict import StrictModel
from rig.specification.sections.plausible import SHARES, Plausible, Share, angle_deg
from solver.matching import Matching, PairTier


class PairTierSection(StrictModel):
    """One step of how many pairs can match a point."""

    pairs: int = Field(
        ge=1, le=124_750, description="Number of pairs of cameras that can match a point."
    )
    share: Share = Field(description="Share that needs them, of the points that can be matched.")


class MatchingSection(StrictModel):
    """Two cameras can match a point that both see, in frame and sharp, within these limits."""

    max_angle_deg: Annotated[float, angle_deg(3.2, 180.0, 40.0)] = Field(
        default=Matching().max_angle_deg,
        description="Greatest angle between the two rays to a point.",
    )
    max_incidence_deg: Annotated[float, angle_deg(2.0, 89.9, 70.0)] = Field(
        default=Matching().max_incidence_deg,
        description="Greatest angle between the point's normal and either ray.",
    )
    max_scale_ratio: Annotated[float, Plausible(1.0, 100.0, 1.5, "", SHARES)] = Field(
        default=Matching().max_scale_ratio,
        description="Greatest ratio of the sizes of the two cameras' pixels at a point.",
    )
    least_shared: Share = Field(
        default=Matching().least_shared,
        description="Share of the points that two cameras must be able to match to be joined: "
        "cameras that are joined, directly or through others, are a group.",
    )

    required: bool = Field(
        default=Matching().required,
        description="Whether it is a limit: all cameras are one group, and the tiers hold.",
    )
    tier: list[PairTierSection] = Field(
        default_factory=list,
        description="How many pairs points must be in. Without one: a pair for 99.5 %.",
    )

    def to_matching(self) -> Matching:
        """The criteria as the solver sees them."""
        tiers = tuple(PairTier(t.pairs, t.share) for t in self.tier) or Matching().tiers
        return Matching(**self.model_dump(exclude={"tier"}), tiers=tiers)

    @classmethod
    def from_matching(cls, matching: Matching) -> Self:
        """The section that describes ``matching``."""
        plain = asdict(matching)
        tiers = [PairTierSection(**tier) for tier in plain.pop("tiers")]
        return cls(**plain, tier=tiers)
