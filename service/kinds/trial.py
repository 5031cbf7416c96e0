"""Trials: whether a rig measures a face, all in the computer."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from service.kinds.base import JobKind, Request, Result
from service.kinds.comparison import Share


class TrialRequest(Request):
    """How to try a rig. Everything may be left out."""

    name: Annotated[str, Field(max_length=100, description="What to call it.")] = ""
    exposure: Annotated[
        Literal["dark", "right", "over"],
        Field(description="Two stops too dark, right, or 1.3 stops too bright."),
    ] = "right"
    radius_mm: Annotated[
        float, Field(gt=0.0, le=1e3, description="Judge what lies this near to the nose's tip.")
    ] = 95.0
    stride_px: Annotated[
        int, Field(ge=1, le=16, description="Pixels between the points of a picture.")
    ] = 2
    limit_rms_mm: Annotated[
        float, Field(gt=0.0, le=100.0, description="Largest rms of a rig that measures the face.")
    ] = 0.1
    least_reached_percent: Annotated[
        float,
        Field(
            ge=0.0,
            le=100.0,
            description="Least share, within 0.5 mm of a point, of what two cameras see.",
        ),
    ] = 90.0
    scale_mm: Annotated[float, Field(gt=0.0, description="End of the colour scale.")] = 0.2
    samples: Annotated[
        int, Field(ge=1, le=4096, description="Rays for each pixel, where Blender photographs.")
    ] = 64
    flip_texture: Annotated[
        bool, Field(description="The texture's picture stands upside down.")
    ] = False
    subdivisions: Annotated[
        int, Field(ge=0, le=3, description="How often the head's mesh is rounded.")
    ] = 1


class RegionPart(Result):
    """A region of the face: errors in mm, the predicted sigma, the measured scatter."""

    region: str
    points: int
    bias_mm: float
    rms_mm: float
    predicted_mm: float
    measured_mm: float
    ratio: Annotated[float, Field(description="Predicted to measured, point by point.")]


class TrialResult(Result):
    """Whether the rig measures the face, and how well."""

    measures: bool
    verdict: str
    cameras: int
    points: int
    bias_mm: float
    rms_mm: float
    median_absolute_mm: float
    percentiles_mm: list[Share]
    reached_percent: Annotated[
        list[Share], Field(description="Of what two cameras see, near a point.")
    ]
    seen_percent: Annotated[
        float, Field(description="Share of the surface about the nose that two cameras see.")
    ]
    regions: list[RegionPart]


TRIAL = JobKind("trial", TrialRequest, TrialResult)
