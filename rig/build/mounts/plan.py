"""A mount plan: the structure, how every camera is set, and what the rounding cost."""

from __future__ import annotations

from dataclasses import dataclass

from geometry.arrays import Floats
from rig.build.mounts.settings import CameraMount
from rig.build.mounts.structure import Structure


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


@dataclass(frozen=True, eq=False)
class MountPlan:
    """A plan that can be built. ``system`` is the kind of mount; ``datum_rig_mm`` (3,).

    ``clashes`` is empty for a plan that can be built. ``steps`` are the assembly steps in order.
    ``yield_share``: share of Monte Carlo rigs, every setting off by a uniform error of half a
    step, that kept all limits; of ``yield_trials``.
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
