"""A mount plan: the structure, how every camera is set, and what the rounding cost."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Floats, frozen
from rig.build.mounts.settings import CameraMount, Setting
from rig.build.mounts.structure import Structure

GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class Figures:
    """What a network of poses is worth: median sigma, and coverage with two and three views."""

    sigma_median_mm: float
    sigma_p95_mm: float
    coverage_2_views: float
    coverage_3_views: float
    feasible: bool
    broken: tuple[str, ...] = ()


@dataclass(frozen=True)
class Price:
    """What building costs: the design, its settings rounded one by one, and then re-optimised."""

    designed: Figures
    rounded: Figures
    built: Figures

    @property
    def sigma_loss(self) -> float:
        """Share by which the median sigma of what is built exceeds that of the design."""
        return self.built.sigma_median_mm / self.designed.sigma_median_mm - 1.0

    @property
    def coverage_loss(self) -> float:
        """Share of the region that lost its second view."""
        return self.designed.coverage_2_views - self.built.coverage_2_views


@dataclass(frozen=True)
class Tolerance:
    """How far one setting may be off, alone, before a limit breaks (``limit`` names it).

    ``plus`` and ``minus`` in the setting's unit; infinite when no limit breaks within the range
    that was tried.
    """

    camera: str
    setting: str
    unit: str
    plus: float
    minus: float
    limit: str


@dataclass(frozen=True)
class Clash:
    """Two things that overlap, or one that stands in a view (``kind`` ``solid`` or ``view``)."""

    kind: str
    one: str
    other: str
    clearance_mm: float
    required_mm: float


@dataclass(frozen=True)
class Give:
    """How far a setting would have to be off to move a camera as its sag does, in its unit.

    ``allowed``: how far it may be off; infinite where no limit breaks. ``step``: to what it can
    be set; 0 where the part is made to the figure. Slides are set by tapes with everything hung
    on the frame, so that whole steps of their sag can be aimed out; an angle is not, for it is
    set on a head that has leaned already.
    """

    setting: str
    unit: str
    off: float
    allowed: float
    step: float

    @property
    def aim_out(self) -> float:
        """What to set more so that the camera, when it has sunk, stands where it should."""
        if self.step <= 0.0:
            return 0.0
        return -self.step * round(self.off / self.step) + 0.0

    @property
    def set_more(self) -> float:
        """What is set more for the weight: whole steps of a slide, nothing of an angle."""
        return self.aim_out if self.unit == "mm" else 0.0

    @property
    def left(self) -> float:
        """What is left of it: of a slide when it is aimed out, of anything else all."""
        return self.off + self.set_more

    @property
    def share(self) -> float:
        """What is left as a share of what is allowed."""
        return abs(self.left) / self.allowed if self.allowed > 0.0 else float(self.left != 0.0)


@dataclass(frozen=True, eq=False)
class Sag:
    """How one camera gives way to the weight of the whole rig.

    ``shift_mm`` (3,) of its optical centre in the rig frame; ``lean_deg`` how far it turns.
    ``touched_mm``, ``touched_deg``: what a touch of 5 N does to it at most, while it lasts.
    ``gives``: the same as errors of its settings.
    """

    camera: str
    shift_mm: Floats
    lean_deg: float
    touched_mm: float
    touched_deg: float
    gives: tuple[Give, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "shift_mm", frozen(self.shift_mm))

    @property
    def shift(self) -> float:
        """How far its optical centre moves, mm."""
        return float(np.linalg.norm(self.shift_mm))

    @property
    def words(self) -> str:
        """What it does where it gives way most, and the limit."""
        worst = self.worst
        unit = "degrees" if worst.unit == "deg" else "mm"
        verb = "leans" if worst.unit == "deg" else "sinks"
        return (
            f"it {verb} by {abs(worst.left):.2f} {unit} of {worst.setting} at {self.camera}, "
            f"the limit is {worst.allowed:.2f}"
        )

    @property
    def worst(self) -> Give:
        """What comes nearest to what is allowed, or goes farthest beyond."""
        return max(self.gives, key=lambda give: give.share)


def set_for_weight(setting: Setting, sag: Sag | None) -> Setting:
    """The setting as a builder sets it, with what is set more or less for the rig's weight."""
    gives = () if sag is None else sag.gives
    more = sum(give.set_more for give in gives if give.setting == setting.name)
    return replace(setting, value=setting.value + more)


@dataclass(frozen=True, eq=False)
class Stance:
    """How one part of a structure that stands by itself resists tipping.

    ``on`` names its feet, ``centre_mm`` (3,) is its centre of mass in the rig frame. A level push
    at ``height_mm`` over the floor, along ``way`` (2,) in the rig's x and y, tips it from
    ``tips_n`` on, negative for what falls over by itself; it is to withstand ``push_n``.
    ``toward``: the way in words.
    """

    on: tuple[str, ...]
    mass_kg: float
    centre_mm: Floats
    height_mm: float
    push_n: float
    tips_n: float
    toward: str
    way: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre_mm", frozen(self.centre_mm))
        object.__setattr__(self, "way", frozen(self.way))

    @property
    def lacks_mm(self) -> float:
        """By how much its foot would have to reach farther that way to withstand the push."""
        weight_n = self.mass_kg * GRAVITY_M_S2
        return max(0.0, (self.push_n - self.tips_n) * self.height_mm / weight_n)

    @property
    def stands(self) -> bool:
        """Whether it withstands the push."""
        return self.tips_n >= self.push_n

    @property
    def words(self) -> str:
        """What it takes to tip it."""
        how = f"a push of {self.tips_n:.0f} N" if self.tips_n > 0.0 else "its own weight"
        return (
            f"what stands on {' and '.join(self.on)} is tipped {self.toward} by {how} at the "
            f"height of the head, {self.push_n:.0f} N are asked"
        )


@dataclass(frozen=True, eq=False)
class MountPlan:
    """A plan that can be built. ``system`` is the kind of mount; ``datum_rig_mm`` (3,).

    ``clashes`` is empty for a plan that can be built. ``steps`` are the assembly steps in order.
    ``yield_share``: share of Monte Carlo rigs, every setting off by a uniform error of half a
    step, that kept all limits; of ``yield_trials``. ``sags``: how each camera gives way under its
    own weight, ``stances``: how what stands by itself resists tipping; empty where the mount is not
    of members.
    """

    name: str
    system: str
    datum_rig_mm: Floats
    structure: Structure
    mounts: tuple[CameraMount, ...]
    price: Price
    tolerances: tuple[Tolerance, ...]
    clashes: tuple[Clash, ...]
    yield_share: float
    yield_trials: int
    steps: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    sags: tuple[Sag, ...] = ()
    stances: tuple[Stance, ...] = ()

    @property
    def buildable(self) -> bool:
        """Whether nothing clashes and no camera leans too far; what tips can be screwed down."""
        return not self.clashes and not self.leaning

    @property
    def tipping(self) -> tuple[Stance, ...]:
        """What does not withstand the push that it should, the weakest first."""
        weak = [stance for stance in self.stances if not stance.stands]
        return tuple(sorted(weak, key=lambda stance: stance.tips_n))

    @property
    def leaning(self) -> tuple[Sag, ...]:
        """Cameras that give way more than a limit of the design allows, the worst first."""
        over = [sag for sag in self.sags if sag.worst.share > 1.0]
        return tuple(sorted(over, key=lambda sag: -sag.worst.share))
