"""Rigs, their devices, and what is asked of them, on the wire."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from service.api.models import Problem
from service.kinds.base import Model
from service.stations.status import CameraStatus, State, TriggerStatus


class RigStatus(Model):
    """A rig: one station that this service owns."""

    name: str
    status: State
    doing: Annotated[str | None, Field(description="Where the job is that it does now.")]
    asked_by: Annotated[
        str, Field(description="Whose key or which operator asked for it; empty: nobody said.")
    ] = ""
    aborts: Annotated[
        int,
        Field(
            description="How often somebody aborted since the service began. Whoever counts down "
            "to a capture stops when it has changed."
        ),
    ] = 0
    problem: Annotated[Problem | None, Field(description="Why it is not open.")]
    trigger: TriggerStatus | None
    cameras: list[CameraStatus]
    links: dict[str, str]


class RigList(Model):
    """The rigs of this service."""

    items: list[RigStatus]
