"""Acceptance tests: whether a calibrated rig measures lengths as it should."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from calibration.defaults import LENGTH_LIMIT, VOLUME_MM
from service.kinds.base import Figure, JobKind, Request, Result
from service.kinds.detection import Detection

Micrometres = Annotated[float, Field(ge=0.0, le=1e6)]
Side = Annotated[float, Field(gt=0.0, le=1e5)]


class Limit(Request):
    """Largest error permitted of a length L: A + K L, at most B."""

    a_um: Micrometres = LENGTH_LIMIT[0]
    k_um_per_m: Micrometres = LENGTH_LIMIT[1]
    b_um: Annotated[float, Field(gt=0.0, le=1e6)] = LENGTH_LIMIT[2]


class MeasuredVolume(Request):
    """The volume that is measured in."""

    width_mm: Side = VOLUME_MM[0]
    height_mm: Side = VOLUME_MM[1]
    depth_mm: Side = VOLUME_MM[2]


class AcceptanceRequest(Request):
    """What to test against, and what stands on the certificate."""

    limit: Limit = Field(default_factory=Limit)
    volume: MeasuredVolume = Field(default_factory=MeasuredVolume)
    rig: Annotated[str, Field(max_length=100)] = ""
    operator: Annotated[str, Field(max_length=100)] = ""
    temperature_degc: Annotated[float | None, Field(ge=-50.0, le=100.0)] = None


class LengthEntry(Result):
    """One length against its limit."""

    line: str
    first: str
    second: str
    calibrated_mm: float
    measured_mm: float
    error_um: float
    sigma_um: Figure
    limit_um: float
    within: bool


class AcceptanceResult(Result):
    """The outcome of an acceptance test."""

    detection: Detection
    outcome: Literal["passed", "failed", "incomplete"]
    text: str
    lines: int
    largest_um: float
    rms_um: float
    scale_ppm: Figure
    scale_sigma_ppm: Figure
    missing: list[str]
    notes: list[str]
    lengths: list[LengthEntry]


ACCEPTANCE = JobKind("acceptance", AcceptanceRequest, AcceptanceResult)
