"""What a matcher can use: which two views of a point look alike enough to be found in each other.

The figures that stand by default are those of dense matching on skin: beyond 40 degrees between two
rays no patch model follows (reconstructions keep to the same limit), surfaces seen at more than 70
degrees tell little, and at half as many pixels again on the one side patches no longer fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.errors import InputError


@dataclass(frozen=True)
class PairTier:
    """At least ``share`` of the points that can be matched is in ``pairs`` such pairs or more."""

    pairs: int
    share: float

    def __post_init__(self) -> None:
        if self.pairs < 1 or not 0.0 < self.share <= 1.0:
            raise InputError(
                "limit-value",
                f"matching asks for {self.share:g} of the points in {self.pairs} pairs",
                "give pairs >= 1 and 0 < share <= 1",
            )


@dataclass(frozen=True)
class Matching:
    """Which pairs of cameras can match a point, and which cameras belong together.

    A pair can where both see the point, in frame and sharp, their rays to it meet at
    ``max_angle_deg`` or less, each at ``max_incidence_deg`` or less from its normal, and a pixel
    of the one is at most ``max_scale_ratio`` times as large there as one of the other. Two
    cameras that share at least ``least_shared`` of the points in this way are joined; cameras
    that are joined, directly or through others, are a group. Raises :class:`InputError` for
    what no pair could meet.

    Where it is ``required`` it is a limit: the ``tiers`` hold, and all cameras are one group.
    """

    max_angle_deg: float = 40.0
    max_incidence_deg: float = 70.0
    max_scale_ratio: float = 1.5
    least_shared: float = 0.1
    required: bool = False
    tiers: tuple[PairTier, ...] = (PairTier(1, 0.995),)

    @property
    def demanded(self) -> tuple[PairTier, ...]:
        """The tiers that are limits."""
        return self.tiers if self.required else ()

    def __post_init__(self) -> None:
        wrong = (
            ("max_angle_deg", self.max_angle_deg, 0.0 < self.max_angle_deg <= 180.0,
             "give more than 0 and at most 180 degrees"),
            ("max_incidence_deg", self.max_incidence_deg, 0.0 < self.max_incidence_deg < 90.0,
             "give more than 0 and less than 90 degrees"),
            ("max_scale_ratio", self.max_scale_ratio,
             np.isfinite(self.max_scale_ratio) and self.max_scale_ratio >= 1.0,
             "give 1 or more: the larger pixel over the smaller"),
            ("least_shared", self.least_shared, 0.0 < self.least_shared <= 1.0,
             "give a share of the points, more than 0 and at most 1"),
        )  # fmt: skip
        for name, value, right, remedy in wrong:
            if not right:
                raise InputError("limit-value", f"matching.{name} is {value:g}", remedy)
