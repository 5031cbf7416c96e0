"""Designs: a scan and a rig's limits in, camera poses and a mount layout out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import Field

from rig.specification.rigfile import RigFile
from rig.specification.spec import RigSpec
from rig.specification.strategies import Strategy
from service.kinds.base import LARGEST_JSON_INTEGER, Figure, JobKind, Model, Request, Result
from service.kinds.evaluation import EvaluationResult
from service.kinds.scanned import rig_for_scan


class DesignRequest(Request):
    """What to design. What is given beside the rig overrides what the rig says."""

    rig: Annotated[RigFile, Field(description="The structure of a rig file, as JSON.")]
    cameras: Annotated[
        int | None,
        Field(ge=0, le=500, description="How many cameras to place; 0 for a rig that stands."),
    ] = None
    seed: Annotated[int | None, Field(ge=0, le=LARGEST_JSON_INTEGER)] = None
    starts: Annotated[int | None, Field(ge=1, le=1000, description="Starts to try.")] = None
    strategy: Annotated[
        Annotated[Strategy, Field(strict=False)] | None,
        Field(description="Where starts come from, as in a rig file."),
    ] = None

    def for_scan(self, options: Mapping[str, str | float]) -> Self:
        """The same, the scan read with its own ``options`` where the rig has none."""
        return self.model_copy(update={"rig": rig_for_scan(self.rig, options)})

    def spec(self) -> RigSpec:
        """The rig with what is asked for instead. Raises :class:`InputError`."""
        given = {
            "cameras": self.cameras,
            "seed": self.seed,
            "starts": self.starts,
            "strategy": self.strategy,
        }
        changed = {name: value for name, value in given.items() if value is not None}
        return self.rig.model_copy(update=changed).to_spec()


class DemoRequest(Request):
    """The example rig, for the bundled head."""


class Conflict(Result):
    """A limit that takes part in a contradiction, and by how much it would have to give way."""

    family: str
    unit: str
    give: Figure
    give_alone: Annotated[
        Figure, Field(description="If it alone gave way; null when that is not enough.")
    ]


class DesignBound(Model):
    """How good any network on a grid of candidates could be, in short."""

    lower_mm2: Annotated[float, Field(description="No network's mean |Q| is below this.")]
    cost_mm2: Annotated[float, Field(description="The design's, over the same points.")]
    gap_share: Annotated[float, Field(description="By which share of it that could be less.")]
    candidates: int
    points: int
    unseen_share: Annotated[float, Field(description="Points that no two candidates see.")]


class DesignResult(EvaluationResult):
    """The figures of a design. When the limits contradict each other it is the nearest one."""

    name: str
    seed: int
    status: str
    why_stopped: str
    start_cost_mm2: Figure
    conflicts: list[Conflict]
    contradiction: str | None = Field(
        default=None,
        description="Which limits no design can hold together and what to relax, where that was "
        "found before anything was searched.",
    )
    bound: DesignBound | None = Field(
        default=None, description="How good it could be at most; null where a limit is broken."
    )
    collisions: int
    seconds: float
    placed: Annotated[
        int | None, Field(description="Cameras placed; 0 for a rig that was told of as it stands.")
    ] = None


class RigExample(Model):
    """A rig that comes with the program."""

    name: str
    rig: Annotated[RigFile, Field(description="What a design takes as `rig`.")]


DESIGN = JobKind("design", DesignRequest, DesignResult)
DEMO = JobKind("demo", DemoRequest, DesignResult)
