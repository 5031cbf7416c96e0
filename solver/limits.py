"""What a rig must respect. Frozen, self-validating; None or an empty tuple switches a limit off.

Names follow the literature; equation numbers are those of the source paper.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from common.errors import InputError
from geometry.arrays import Floats, frozen
from solver.matching import Matching


def _bad(problem: str, remedy: str) -> InputError:
    return InputError("limit-value", problem, remedy)


def _non_negative(owner: str, **values: float | None) -> None:
    for name, value in values.items():
        if value is not None and not (np.isfinite(value) and value >= 0.0):
            raise _bad(f"{owner}.{name} is {value}", "give a number of zero or more")


def _ordered(owner: str, low: float | None, high: float | None) -> None:
    if low is not None and high is not None and low > high:
        raise InputError(
            "limits-contradict",
            f"{owner}: the minimum {low:g} is above the maximum {high:g}",
            "lower the minimum or raise the maximum",
        )


@dataclass(frozen=True)
class PoseBounds:
    """Eq 8: how far each camera may move from its start.

    Half ranges about the start; None leaves that coordinate free. Angles are the
    photogrammetric omega, phi, kappa.
    """

    omega_deg: float | None = None
    phi_deg: float | None = None
    kappa_deg: float | None = None
    x_mm: float | None = None
    y_mm: float | None = None
    z_mm: float | None = None

    def __post_init__(self) -> None:
        _non_negative("bounds", **self.__dict__)

    @property
    def binds_angles(self) -> bool:
        """Whether any angle is bounded."""
        return any(v is not None for v in (self.omega_deg, self.phi_deg, self.kappa_deg))


@dataclass(frozen=True)
class BaseHeight:
    """Eq 9: base/height ratio of camera pairs.

    B is the distance of two projection centres, H the mean of their distances to the centroid
    of the object. ``min`` and ``max`` hold for every pair, ``mean_min`` and ``mean_max`` for
    the mean over pairs, ``neighbour_max`` for each camera and its nearest neighbour (what
    dense matching needs).
    """

    min: float | None = None
    max: float | None = None
    mean_min: float | None = None
    mean_max: float | None = None
    neighbour_max: float | None = None

    def __post_init__(self) -> None:
        _non_negative("base_height", **self.__dict__)
        _ordered("base_height", self.min, self.max)
        _ordered("base_height mean", self.mean_min, self.mean_max)
        _ordered("base_height", self.min, self.neighbour_max)


@dataclass(frozen=True)
class Incidence:
    """Eq 10: angles of incidence.

    ``ray_max_deg``: a point counts as seen only up to this angle between its normal
    and the ray to the camera. ``mean_max_deg``: limit for each camera's mean angle between its
    optical axis and the normals of the points (the figure in the paper's Table 2).
    """

    ray_max_deg: float = 75.0
    mean_max_deg: float | None = None

    def __post_init__(self) -> None:
        _non_negative("incidence", ray_max_deg=self.ray_max_deg, mean_max_deg=self.mean_max_deg)
        if self.ray_max_deg > 89.0:
            raise _bad(f"incidence.ray_max_deg is {self.ray_max_deg:g}", "give at most 89 degrees")


@dataclass(frozen=True)
class Frame:
    """Eq 11: every point a camera sees lies inside its frame, ``margin_px`` from the border."""

    margin_px: float = 0.0

    def __post_init__(self) -> None:
        _non_negative("frame", margin_px=self.margin_px)


@dataclass(frozen=True)
class Centring:
    """Eq 12: the mean image coordinates of the object's points are zero within tolerance."""

    tolerance_px: float = 0.0

    def __post_init__(self) -> None:
        _non_negative("centring", tolerance_px=self.tolerance_px)


@dataclass(frozen=True)
class Spacing:
    """Eq 13: the mean Delaunay edge between cameras equals ``edge_mm`` within ``tolerance_mm``."""

    edge_mm: float
    tolerance_mm: float = 0.0

    def __post_init__(self) -> None:
        _non_negative("spacing", edge_mm=self.edge_mm, tolerance_mm=self.tolerance_mm)


@dataclass(frozen=True)
class Symmetry:
    """Eqs 14 and 15, per axis of the rig frame about the object's centroid.

    ``median_tolerance_mm``: mean and median of the camera coordinates agree (14).
    ``balance_tolerance_mm``: the mean of the coordinates is zero, which is what equal sums of
    the negative and the positive ones say (15). None switches one off.
    """

    axes: str = "x"
    median_tolerance_mm: float | None = 0.0
    balance_tolerance_mm: float | None = None

    def __post_init__(self) -> None:
        _non_negative(
            "symmetry",
            median_tolerance_mm=self.median_tolerance_mm,
            balance_tolerance_mm=self.balance_tolerance_mm,
        )
        if not self.axes or set(self.axes) - set("xyz") or len(set(self.axes)) != len(self.axes):
            raise _bad(
                f"symmetry.axes is {self.axes!r}", "name each axis once, for example 'x' or 'xz'"
            )

    @property
    def axis_indices(self) -> tuple[int, ...]:
        """Indices of the axes, 0 for X."""
        return tuple("xyz".index(a) for a in self.axes)


@dataclass(frozen=True)
class CoverageTier:
    """At least ``share`` of the points is seen by ``views`` cameras or more."""

    views: int
    share: float

    def __post_init__(self) -> None:
        if self.views < 1 or not 0.0 < self.share <= 1.0:
            raise _bad(
                f"coverage asks for {self.share} of the points in {self.views} views",
                "give views >= 1 and 0 < share <= 1",
            )


@dataclass(frozen=True)
class Coverage:
    """How often points must be seen, and what an unseen point costs.

    ``unseen_sigma_mm`` is the standard deviation that a point has before anybody looks: it
    enters every normal matrix as prior information, so that losing a point is never a gain.
    """

    tiers: tuple[CoverageTier, ...] = ()
    unseen_sigma_mm: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.unseen_sigma_mm) and self.unseen_sigma_mm > 0.0):
            raise _bad(
                f"coverage.unseen_sigma_mm is {self.unseen_sigma_mm}", "give a positive length"
            )


ROLL_TOLERANCE_DEG = 0.5
"""A picture within this of level is level: what a person sets by the bubble of a head, and what a
matcher never notices. A design holds its rolls exactly."""


class Roll(StrEnum):
    """How pictures may be turned about their cameras' axes, level being upright to the head.

    Portrait is a quarter turn to either side.
    """

    FREE = "free"
    LEVEL = "level"
    PORTRAIT = "portrait"
    LEVEL_OR_PORTRAIT = "level-or-portrait"

    @property
    def allowed_deg(self) -> tuple[float, ...]:
        """The rolls that are allowed; none where every one is."""
        level = (0.0,) if self in (Roll.LEVEL, Roll.LEVEL_OR_PORTRAIT) else ()
        portrait = (90.0, -90.0) if self in (Roll.PORTRAIT, Roll.LEVEL_OR_PORTRAIT) else ()
        return level + portrait

    @property
    def at_start_deg(self) -> tuple[float, ...]:
        """The rolls of which a start takes the better: a half turn shows the same upside down."""
        return tuple(a for a in self.allowed_deg if a >= 0.0) or (0.0, 90.0)

    def nearest_deg(self, roll_deg: float) -> float:
        """The allowed roll that is nearest to one; itself where every one is allowed."""

        def away(allowed: float) -> float:
            return abs((roll_deg - allowed + 180.0) % 360.0 - 180.0)

        return min(self.allowed_deg, key=away, default=roll_deg)


@dataclass(frozen=True)
class StandOff:
    """Distance of each projection centre from the centroid of the object."""

    min_mm: float | None = None
    max_mm: float | None = None

    def __post_init__(self) -> None:
        _non_negative("stand_off", **self.__dict__)
        _ordered("stand_off", self.min_mm, self.max_mm)


@dataclass(frozen=True)
class Box:
    """A box along the axes of the rig frame, ``low_mm`` (3,) to ``high_mm`` (3,)."""

    low_mm: Floats
    high_mm: Floats

    def __post_init__(self) -> None:
        low, high = frozen(self.low_mm), frozen(self.high_mm)
        if low.shape != (3,) or high.shape != (3,) or not (low < high).all():
            raise _bad(
                "a zone's box does not have low < high in x, y and z",
                "give two corners of 3 numbers",
            )
        object.__setattr__(self, "low_mm", low)
        object.__setattr__(self, "high_mm", high)


@dataclass(frozen=True)
class Sphere:
    """A ball."""

    centre_mm: Floats
    radius_mm: float

    def __post_init__(self) -> None:
        centre = frozen(self.centre_mm)
        if centre.shape != (3,) or not np.isfinite(centre).all() or not self.radius_mm > 0.0:
            raise _bad(
                "a zone's sphere is malformed", "give a centre of 3 numbers and a positive radius"
            )
        object.__setattr__(self, "centre_mm", centre)


@dataclass(frozen=True)
class HalfSpace:
    """The side of a plane to which ``normal`` (3,) points: ``normal . x >= offset_mm``."""

    normal: Floats
    offset_mm: float

    def __post_init__(self) -> None:
        normal = np.array(self.normal, dtype=np.float64)
        length = float(np.linalg.norm(normal))
        if (
            normal.shape != (3,)
            or not np.isfinite(length)
            or length == 0.0
            or not np.isfinite(self.offset_mm)
        ):
            raise _bad(
                "a zone's plane is malformed",
                "give a normal of 3 numbers, not all zero, and an offset",
            )
        object.__setattr__(self, "normal", frozen(normal / length))


Zone = Box | Sphere | HalfSpace


class ZoneOrigin(StrEnum):
    """What zones are given about: the foremost point of the subject, or the rig frame's origin."""

    HEAD = "head"
    RIG = "rig"


@dataclass(frozen=True)
class Zones:
    """Where cameras may stand.

    A body lies wholly inside one of ``allowed`` (when any are given) and wholly outside each of
    ``forbidden``. ``about`` says what their coordinates start from; without it,
    :func:`solver.zones.origin_of` does.
    """

    allowed: tuple[Zone, ...] = ()
    forbidden: tuple[Zone, ...] = ()
    about: ZoneOrigin | None = None


@dataclass(frozen=True)
class MotionBox:
    """Displacements and turns of the head for which the design must hold, half ranges.

    Turns are about the centroid of the design points: pitch about X, roll about Y, yaw about Z.
    """

    x_mm: float = 0.0
    y_mm: float = 0.0
    z_mm: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    yaw_deg: float = 0.0

    def __post_init__(self) -> None:
        _non_negative("motion", **self.__dict__)
        if max(self.pitch_deg, self.roll_deg, self.yaw_deg) > 45.0:
            raise _bad("motion allows turns beyond 45 degrees", "give at most 45 degrees")


@dataclass(frozen=True)
class Limits:
    """All limits of a rig. What is None (or False) is switched off."""

    image_sigma_px: float = 0.5
    bounds: PoseBounds | None = None
    base_height: BaseHeight = field(default_factory=BaseHeight)
    incidence: Incidence = field(default_factory=Incidence)
    frame: Frame | None = field(default_factory=Frame)
    centring: Centring | None = None
    spacing: Spacing | None = None
    symmetry: Symmetry | None = None
    coverage: Coverage = field(default_factory=Coverage)
    depth_of_field: bool = True
    gsd_max_mm: float | None = None
    roll: Roll = Roll.FREE
    stand_off: StandOff = field(default_factory=StandOff)
    body_clearance_mm: float | None = 0.0
    sight_line_clearance_mm: float | None = 0.0
    zones: Zones = field(default_factory=Zones)
    motion: MotionBox | None = None
    matching: Matching = field(default_factory=Matching)

    def __post_init__(self) -> None:
        _non_negative(
            "limits",
            gsd_max_mm=self.gsd_max_mm,
            body_clearance_mm=self.body_clearance_mm,
            sight_line_clearance_mm=self.sight_line_clearance_mm,
        )
        if not (np.isfinite(self.image_sigma_px) and self.image_sigma_px > 0.0):
            raise _bad(
                f"image_sigma_px is {self.image_sigma_px}", "give a positive number of pixels"
            )
