"""Comparisons of a cloud with a reference surface."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from service.kinds.base import JobKind, Request, Result

Alignments = Literal["none", "best-fit", "best-fit-scale"]


class Ball(Request):
    """A part of space: all within ``radius_mm`` of ``centre_mm``."""

    centre_mm: tuple[float, float, float]
    radius_mm: Annotated[float, Field(gt=0.0)]


class ComparisonRequest(Request):
    """How to compare. Everything may be left out."""

    align: Annotated[Alignments, Field(description="How the cloud is put onto the reference.")] = (
        "none"
    )
    within: Annotated[Ball | None, Field(description="Compare this part only.")] = None
    limit_mm: Annotated[
        float, Field(gt=0.0, description="Points farther off belong to something else.")
    ] = 5.0
    scale_mm: Annotated[float, Field(gt=0.0, description="End of the colour scale.")] = 0.2


class Share(Result):
    """A figure at a place of its scale."""

    at: float
    value: float


class ComparisonResult(Result):
    """Distances of the cloud to the reference, mm; shares of the reference, percent."""

    points: int
    left_out: int
    bias_mm: float
    rms_mm: float
    median_absolute_mm: float
    mad_mm: float
    percentiles_mm: list[Share]
    reached_percent: list[Share]
    points_per_mm2: float
    align: Alignments
    scale: float
    converged: bool


COMPARISON = JobKind("comparison", ComparisonRequest, ComparisonResult)
