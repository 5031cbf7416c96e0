"""Rigs, their devices, and what is asked of them, on the wire."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from service.api.models import Problem
from service.kinds.base import Figure, Model


class TriggerStatus(Model):
    """How the trigger box and its line are."""

    state: str
    identity: str
    serial_number: str
    firmware: str
    boots: int | None
    interlock_closed: bool | None
    armed_capture: str | None
    clock_residual_us: Figure
    round_trip_p50_ms: Figure
    round_trip_p99_ms: Figure
    counters: dict[str, int]
    last_problem: str


class CameraStatus(Model):
    """How a camera is; `problem` is empty when all is well."""

    name: str
    backend: str
    id: str
    output: int | None
    connected: bool
    armed: bool
    problem: str
    counters: dict[str, int]


class RigStatus(Model):
    """A rig: one station that this service owns."""

    name: str
    status: Literal["ready", "busy", "degraded", "closed"]
    doing: Annotated[str | None, Field(description="Where the job is that it does now.")]
    problem: Annotated[Problem | None, Field(description="Why it is not open.")]
    trigger: TriggerStatus | None
    cameras: list[CameraStatus]
    links: dict[str, str]


class RigList(Model):
    """The rigs of this service."""

    items: list[RigStatus]
