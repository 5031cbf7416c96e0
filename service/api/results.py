"""What a completed design or evaluation reports in short; the files hold the rest."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from service.api.models import Model, Note


class Coverage(Model):
    """Share of the region's points seen by ``views`` cameras or more."""

    views: int
    share: float


class Conflict(Model):
    """A limit that takes part in a contradiction, and by how much it would have to give way."""

    family: str
    unit: str
    give: float | None
    give_alone: Annotated[
        float | None, Field(description="If it alone gave way; null when that is not enough.")
    ]


class EvaluationResult(Model):
    """The figures of given cameras."""

    feasible: Annotated[bool, Field(description="Whether every limit is satisfied.")]
    cameras: int
    cost_mm2: float | None
    sigma_median_mm: float | None
    sigma_p95_mm: float | None
    sigma_max_mm: float | None
    coverage: list[Coverage]
    in_focus_share: float | None
    in_frame_share: float | None
    violated: Annotated[list[str], Field(description="Names of the limits that are broken.")]
    notes: Annotated[
        list[Note],
        Field(description="What was inferred or changed to read the scan and find the face."),
    ]


class DesignResult(EvaluationResult):
    """The figures of a design. When the limits contradict each other it is the nearest one."""

    name: str
    seed: int
    status: str
    why_stopped: str
    start_cost_mm2: float | None
    conflicts: list[Conflict]
    collisions: int
    seconds: float
