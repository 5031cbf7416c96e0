"""The rules that a detection must pass, and what is said of those that do not."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from common.errors import InputError


class Rule(Enum):
    """Why something that looked like a target was not used."""

    UNIQUE_ID = "unique-id"
    CODE = "code"
    SIZE = "size"
    EDGE = "edge"
    SATURATION = "saturation"
    CONTRAST = "contrast"
    BLUR = "blur"
    FIT = "fit"
    HOMOGRAPHY = "homography"
    POSE = "pose"
    UPRIGHT = "upright"

    @property
    def meaning(self) -> str:
        """The rule in words, as it stands in the documentation."""
        return _MEANINGS[self]


_MEANINGS = {
    Rule.UNIQUE_ID: "each target is seen once in a picture; an id seen twice is not used at all",
    Rule.CODE: "the code that was read belongs to the target set, unmirrored and without doubt",
    Rule.SIZE: "the target is large enough in the picture to be measured",
    Rule.EDGE: "the target and a margin round it lie within the picture",
    Rule.SATURATION: "neither its white nor its black is cut off by the camera",
    Rule.CONTRAST: "white and black differ enough",
    Rule.BLUR: "it is sharp enough for its size",
    Rule.FIT: "the picture looks like the target that was printed",
    Rule.HOMOGRAPHY: "it lies where its neighbours on the same plane say",
    Rule.POSE: "it lies where the other targets of its carrier say",
    Rule.UPRIGHT: "a board that looks the same when it is turned is held upright",
}


@dataclass(frozen=True)
class Rejection:
    """One target that was seen and is not used: by which rule, what was measured, what is allowed.

    ``pixel`` is about where it is.
    """

    target: str
    rule: Rule
    measured: float
    limit: float
    pixel: tuple[float, float]

    def __str__(self) -> str:
        """One line for a report."""
        at = f"({self.pixel[0]:.0f}, {self.pixel[1]:.0f})"
        values = f"{self.measured:.3g}, allowed {self.limit:.3g}"
        return f"{self.target} at {at}: {self.rule.value} ({values})"


@dataclass(frozen=True)
class Gates:
    """The limits of the rules.

    ``smallest_square_px``, ``smallest_marker_px``, ``smallest_dot_px`` (radius): the shorter way
    across. ``edge_px``: between a target and the border of the picture. ``saturated_share``: of
    the target's pixels at the first or last grey level. ``contrast``: white less black, of 255.
    ``blur_share``: the blur's sigma in parts of a square, a marker's module or a dot's radius.
    ``misfit``: rms residual over contrast. ``plane_px`` and ``plane_share`` (of a square):
    distance from where the neighbours say. ``pose_share``: the same on a carrier of separate
    targets, in parts of the carrier's extent in the picture. Raises :class:`InputError`.
    """

    smallest_square_px: float = 10.0
    smallest_marker_px: float = 14.0
    smallest_dot_px: float = 2.5
    edge_px: float = 2.0
    saturated_share: float = 0.2
    contrast: float = 12.0
    blur_share: float = 0.4
    misfit: float = 0.16
    plane_px: float = 0.5
    plane_share: float = 0.02
    pose_share: float = 0.03

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0.0):
                raise InputError("gates", f"the gate {name} is {value}", "give zero or more")
