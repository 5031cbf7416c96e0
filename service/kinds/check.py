"""Checks: whether a rig is still as it was calibrated, and which camera is not."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from calibration.check import Kind
from calibration.defaults import HIDDEN_LIMIT_MM, TOLERANCE_MM
from service.kinds.base import Figure, JobKind, Request, Result
from service.kinds.detection import Detection

Light = Literal["green", "yellow", "red"]


class CheckRequest(Request):
    """What matters at the subject."""

    tolerance_mm: Annotated[
        float,
        Field(ge=0.0, le=1e3, description="Smaller effects at the subject turn no light red."),
    ] = TOLERANCE_MM
    hidden_limit_mm: Annotated[
        float,
        Field(gt=0.0, le=1e3, description="A camera that could hide more than this is not fine."),
    ] = HIDDEN_LIMIT_MM


class FindingEntry(Result):
    """One thing that a check found. ``docs/explanation/calibration.md`` lists the kinds."""

    kind: Kind
    light: Light
    subjects: list[str]
    text: str
    effect_px: Figure
    effect_mm: Annotated[Figure, Field(description="At the subject.")]
    log10_p: Annotated[
        Figure, Field(description="Decimal logarithm of the chance of it by accident.")
    ]


class CameraVerdict(Result):
    """One camera: its verdict, its tests, and the smallest change they would have seen."""

    name: str
    verdict: Kind
    reason: str
    points: int
    rms_px: Figure
    pose_statistic: Figure
    pose_limit: Figure
    lens_statistic: Figure
    lens_limit: Figure
    effect_px: Figure
    effect_mm: Figure
    smallest_turn_urad: Annotated[
        list[Figure] | None,
        Field(description="Turns about its axes that 95 of 100 checks would report."),
    ]
    smallest_shift_um: Annotated[
        list[Figure] | None,
        Field(description="Shifts along its axes that 95 of 100 checks would report."),
    ]
    hidden_mm: Annotated[
        Figure, Field(description="Largest effect at the subject that could go unseen.")
    ]


class CheckOutcome(Result):
    """The verdict on a rig."""

    detection: Detection
    light: Light
    text: Annotated[str, Field(description="All findings as sentences.")]
    findings: list[FindingEntry]
    cameras: list[CameraVerdict]
    scale_ppm: Figure
    scale_sigma_ppm: Figure
    rms_px: Figure
    points: int
    outliers: int
    notes: list[str]


CHECK = JobKind("check", CheckRequest, CheckOutcome)
