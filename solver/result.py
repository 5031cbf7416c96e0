"""What a design or an evaluation returns. Frozen; every result carries its own quality."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from geometry.arrays import Floats, Ints
from geometry.camera import RigCamera
from geometry.surface import SurfacePoints
from solver.coverage.matchable import Matchable
from solver.limits import Limits


class Sense(StrEnum):
    """Direction of a limit."""

    AT_MOST = "<="
    AT_LEAST = ">="
    EQUAL = "=="


@dataclass(frozen=True)
class ConstraintRow:
    """One limit at its worst place.

    ``name`` is ``family/subject``, for example ``frame/cam03`` or ``base_height_min/cam01-cam02``.
    ``slack`` is in ``unit`` and negative when the limit is broken; for an equality it is the
    tolerance less the deviation. ``active``: the limit binds, i.e. its slack is below
    ``1e-3`` of its scale; an equality with a tolerance does so only near an end of it.
    """

    name: str
    value: float
    limit: float
    sense: Sense
    unit: str
    slack: float
    active: bool
    satisfied: bool

    @property
    def family(self) -> str:
        """The kind of limit."""
        return self.name.split("/", 1)[0]

    @property
    def subject(self) -> str:
        """Whom the limit is about."""
        return self.name.split("/", 1)[-1]


@dataclass(frozen=True)
class CoverageShare:
    """Share of the points seen by ``views`` cameras or more, in the worst head position."""

    views: int
    share: float


@dataclass(frozen=True, eq=False)
class PointTable:
    """Per point of the region: where it is and how well it is determined.

    ``covariance_mm2`` (N, 3, 3); ``sigma_mm`` (N,) the longest semi-axis of the error ellipsoid
    (1 sigma); ``views`` (N,) how many cameras see it; ``in_focus`` (N,) how many of them see it
    sharp. With no view at all a point has the prior sigma.
    """

    points: SurfacePoints
    covariance_mm2: Floats
    sigma_mm: Floats
    views: Ints
    in_focus: Ints

    @property
    def norm_mm2(self) -> Floats:
        """Norm of the eigenvalues of each covariance, (N,): what the cost is the mean of."""
        return np.asarray(np.linalg.norm(self.covariance_mm2, axis=(1, 2)))


@dataclass(frozen=True, eq=False)
class CameraTable:
    """Per camera (n,): what it sees and how.

    ``points_seen`` count; ``gsd_mm`` (n, 3) smallest, mean, largest ground sample distance;
    ``incidence_deg`` (n, 2) mean and largest angle between ray and normal; ``depth_mm`` (n, 2)
    nearest and farthest seen point; ``focus_mm`` (n, 2) limits of the depth of field;
    ``distance_mm`` (n,) to the centroid; ``nearest_body_mm`` (n,) clearance to the next body;
    ``roll_deg`` (n,) about the axis from level, clockwise as seen from behind.
    """

    points_seen: Ints
    gsd_mm: Floats
    incidence_deg: Floats
    depth_mm: Floats
    focus_mm: Floats
    distance_mm: Floats
    nearest_body_mm: Floats
    roll_deg: Floats


@dataclass(frozen=True, eq=False)
class Quality:
    """Every figure of a network of given poses; design and evaluate report the same.

    ``cost_mm2`` is the mean over the check points of the norm of the eigenvalues of Q (Eq 7).
    ``base_height`` (n, n), ``convergence_deg`` (n, n) are symmetric tables of camera pairs.
    """

    cost_mm2: float
    sigma_median_mm: float
    sigma_p95_mm: float
    sigma_max_mm: float
    coverage: tuple[CoverageShare, ...]
    in_focus_share: float
    in_frame_share: float
    base_height: Floats
    convergence_deg: Floats
    cameras: CameraTable
    points: PointTable
    constraints: tuple[ConstraintRow, ...]
    matchable: Matchable

    @property
    def feasible(self) -> bool:
        """Whether every limit is satisfied."""
        return all(row.satisfied for row in self.constraints)

    @property
    def rank(self) -> tuple[float, float]:
        """Less is better: feasible before infeasible by relative violation, then by cost."""
        violation = sum(max(0.0, -r.slack) / max(abs(r.limit), 1e-3) for r in self.violated)
        return violation, self.cost_mm2

    @property
    def violated(self) -> tuple[ConstraintRow, ...]:
        """The limits that are broken."""
        return tuple(row for row in self.constraints if not row.satisfied)


NOBODY = "none"
"""The engine of a design in which nothing was optimised."""


class Status(StrEnum):
    """How a design ended."""

    CONVERGED = "converged"
    STOPPED = "stopped"
    INFEASIBLE = "infeasible"


@dataclass(frozen=True)
class StartReport:
    """How one start went. ``violation`` is the largest scaled violation of any limit."""

    index: int
    kind: str
    feasible: bool
    cost_mm2: float
    violation: float
    iterations: int
    rounds: int
    why_stopped: str


@dataclass(frozen=True)
class Relaxation:
    """A limit that takes part in a contradiction.

    ``give_mm`` etc. would be ambiguous, so ``give`` is in ``unit``: by how much the limit has to
    give way in the nearest design. ``give_alone``: by how much if it alone gave way; None when
    giving way alone is not enough.
    """

    family: str
    unit: str
    amount: float
    amount_alone: float | None


@dataclass(frozen=True)
class Bound:
    """How good any network on a grid of candidates could be.

    ``lower_mm2``: the mean |Q| of none is below this. ``cost_mm2``: that of the design, over the
    same ``points``, which are weighted to stand for all. ``candidates``: how many were looked at.
    ``unseen_share``: share of all check points that no two of them, the design's included, see.
    """

    lower_mm2: float
    cost_mm2: float
    candidates: int
    points: int
    unseen_share: float

    @property
    def gap_share(self) -> float:
        """By which share of it the design's cost could at most be less, 0 to 1."""
        return 1.0 - self.lower_mm2 / self.cost_mm2


@dataclass(frozen=True)
class SolverReport:
    """Why the solver stopped and how good its answer is as an optimum.

    ``starts_note``: why starts were tried that the strategy is not made of, if any were.
    ``contradiction``: which limits no design can hold together and what to relax, where that was
    found before anything was searched.
    """

    engine: str
    status: Status
    why_stopped: str
    kkt_error: float
    iterations: int
    rounds: int
    seed: int
    seconds: float
    starts: tuple[StartReport, ...]
    conflicts: tuple[Relaxation, ...] = ()
    starts_note: str = ""
    contradiction: str | None = None
    bound: Bound | None = None


@dataclass(frozen=True, eq=False)
class Design:
    """Optimised camera poses with the evidence that they are good.

    ``start`` holds the poses and figures of the best start before optimisation.
    """

    cameras: tuple[RigCamera, ...]
    quality: Quality
    start_cameras: tuple[RigCamera, ...]
    start_quality: Quality
    limits: Limits
    solver: SolverReport

    @property
    def feasible(self) -> bool:
        """Whether every limit is satisfied."""
        return self.quality.feasible

    @property
    def stands(self) -> bool:
        """Whether the rig was there already, and nothing was placed."""
        return self.solver.engine == NOBODY and self.solver.contradiction is None
