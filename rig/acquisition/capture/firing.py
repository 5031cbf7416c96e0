"""What goes into a run and what comes out of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

from rig.acquisition.cameras.base import (
    CameraCapabilities,
    CameraSettings,
    ClockSample,
    TriggerKind,
)
from rig.acquisition.capture.camerathreads import CameraThread
from rig.acquisition.capture.collect import Collected
from rig.acquisition.station.spec import CapturePolicy
from rig.acquisition.synchrony.faults import Fault
from rig.acquisition.synchrony.triggertimes import HostInterval
from rig.acquisition.trigger.box import ArmRequest, FireOutcome, FireReport


class Fate(StrEnum):
    """What is known of a capture's FIRE."""

    NOT_FIRED = "not-fired"
    UNKNOWN = "unknown"
    FIRED = "fired"


FATES = {
    FireOutcome.FIRED: Fate.FIRED,
    FireOutcome.PARTIAL: Fate.FIRED,
    FireOutcome.NOT_FIRED: Fate.NOT_FIRED,
    FireOutcome.UNKNOWN: Fate.UNKNOWN,
}


@dataclass(frozen=True)
class CaptureOrder:
    """One capture as it was asked for. ``box_capture`` is its name at the box.

    ``number`` is its number in its session, 0 for what is in none.
    """

    capture_id: str
    box_capture: str
    shots: int = 1
    interval_us: float = 0.0
    allow_partial: bool = False
    number: int = 0


@dataclass(frozen=True, eq=False)
class Ready:
    """A camera that is armed, and what it said meanwhile."""

    settings: CameraSettings
    armed_host_ns: int
    clock_samples: tuple[ClockSample, ...]


@dataclass(frozen=True, eq=False)
class Firing:
    """What the devices gave. ``fired_at`` is wall-clock time of ``fired.middle_ns``."""

    order: CaptureOrder
    request: ArmRequest | None
    report: FireReport | None
    fired: HostInterval
    fired_at: datetime
    threads: tuple[CameraThread, ...]
    ready: Mapping[str, Ready]
    collected: Mapping[str, Collected]
    absent: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()


def file_wait_ns(policy: CapturePolicy, capabilities: CameraCapabilities) -> int:
    """How much later than told the shot of a camera that is seen through its files may be.

    Where the box does not fire it, somebody does when he pleases.
    """
    edge = capabilities.trigger is TriggerKind.EDGE
    return 0 if edge else round(policy.frame_deadline_s * 1e9)
