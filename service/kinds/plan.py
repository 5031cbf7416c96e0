"""Mount plans: what holds the cameras of a design."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from rig.build.mounts.systemfile import SystemFile
from rig.catalogue import load_catalogue
from service.kinds.base import LARGEST_JSON_INTEGER, Figure, JobKind, Request, Result
from service.kinds.defaults import PAPER

Paper = Literal["A4", "A3"]
PAPERS: dict[str, Paper] = {"A4": "A4", "A3": "A3"}


class PlanRequest(Request):
    """What to plan: a mount for the cameras of a design."""

    mount: Annotated[SystemFile, Field(description="The structure of a system file, as JSON.")]
    name: Annotated[str, Field(max_length=100, description="What to call it.")] = ""
    seed: Annotated[
        int, Field(ge=0, le=LARGEST_JSON_INTEGER, description="Of the trials of tolerances.")
    ] = 0
    paper: Annotated[Paper, Field(description="Of drilling templates.")] = PAPER
    step: Annotated[bool, Field(description="Write printed parts as STEP too.")] = False

    def check(self) -> None:
        """Raise :class:`~common.errors.InputError` for parts that there are not."""
        self.mount.checked(load_catalogue())


class PlanNetwork(Result):
    """What a network of poses is worth."""

    sigma_median_mm: Figure
    sigma_p95_mm: Figure
    coverage_2_views: float
    coverage_3_views: float
    feasible: bool
    broken: list[str]


class PlanPrice(Result):
    """What building costs: as designed, rounded one by one, and re-optimised."""

    designed: PlanNetwork
    rounded: PlanNetwork
    built: PlanNetwork
    sigma_loss: Annotated[Figure, Field(description="Share of the median sigma.")]
    coverage_loss: Annotated[Figure, Field(description="Share of points with two views.")]


class PlanClash(Result):
    """Two things that overlap, or one that stands in a view."""

    kind: str
    one: str
    other: str
    clearance_mm: Figure
    required_mm: Figure


class PlanTolerance(Result):
    """How far a setting may be off, alone; null: farther than was tried."""

    camera: str
    setting: str
    unit: str
    plus: Figure
    minus: Figure
    limit: str


class PlanSetting(Result):
    """One figure to set. ``step`` 0: made to the figure."""

    name: str
    value: float
    unit: str
    step: float


class PlanCamera(Result):
    """How one camera is set."""

    name: str
    settings: list[PlanSetting]


class PlanSag(Result):
    """How a camera gives way under the weight of the rig, and to a touch of 5 N."""

    camera: str
    sinks_mm: Annotated[Figure, Field(description="How far its optical centre moves.")]
    leans_deg: Figure
    touched_mm: Figure
    touched_deg: Figure
    too_far: Annotated[
        str, Field(description="Which limit it goes beyond, in words; empty where none.")
    ]


class PlanStance(Result):
    """How something that stands by itself resists a level push at the height of the head."""

    on: Annotated[list[str], Field(description="Its feet.")]
    mass_kg: Figure
    height_mm: Annotated[Figure, Field(description="Of the push, over the floor.")]
    push_n: Annotated[Figure, Field(description="The push that it is to withstand.")]
    tips_n: Annotated[
        Figure, Field(description="The push that tips it; negative: it falls by itself.")
    ]
    too_little: Annotated[str, Field(description="That it tips, in words; empty where not.")]


class PlanResult(Result):
    """A plan in short; its files hold the rest."""

    name: str
    system: str
    buildable: Annotated[
        bool,
        Field(
            description="Whether nothing clashes and no camera leans beyond what the design allows."
        ),
    ]
    clashes: list[PlanClash]
    price: PlanPrice
    yield_share: Annotated[
        Figure, Field(description="Share of rigs built with small errors that keep limits.")
    ]
    yield_trials: int
    tightest: Annotated[
        list[PlanTolerance], Field(description="Of each kind of setting the tightest.")
    ]
    members: int
    member_length_mm: float
    plates: int
    wedges: int
    parts: int
    cameras: list[PlanCamera]
    steps: Annotated[list[str], Field(description="How to put it together, in order.")]
    notes: list[str]
    sags: list[PlanSag] = Field(
        default_factory=list, description="How each camera gives way under the rig's own weight."
    )
    stances: list[PlanStance] = Field(
        default_factory=list, description="How what stands by itself resists tipping."
    )


PLAN = JobKind("plan", PlanRequest, PlanResult)
