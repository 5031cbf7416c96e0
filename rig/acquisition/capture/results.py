"""What the functions of a rig answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from common.errors import DeviceError, InputError
from rig.acquisition.cameras.base import CameraHealth
from rig.acquisition.session.records import CaptureRecord
from rig.acquisition.station.delays import Timing
from rig.acquisition.station.spec import Station
from rig.acquisition.synchrony.faults import HARMLESS, Fault
from rig.acquisition.synchrony.lags import LagEstimate, estimate_lags, new_timings
from rig.acquisition.synchrony.verdict import Evidence
from rig.acquisition.trigger.box import TriggerHealth


@dataclass(frozen=True)
class CaptureResult:
    """A committed capture. ``repeated``: it had been committed before; nothing was fired now."""

    record: CaptureRecord
    folder: Path
    repeated: bool = False

    @property
    def error(self) -> DeviceError | None:
        """What to raise for a capture that should have been complete and is not; else None.

        The pictures that came are in the session all the same.
        """
        if self.record.state == "complete" or self.record.partial_allowed:
            return None
        # What is missing must not be buried under what does no harm.
        told = [fault.text for fault in self.record.faults if fault.kind not in HARMLESS]
        more = f", and {len(told) - 3} more" if len(told) > 3 else ""
        return DeviceError(
            "capture-partial",
            f"capture {self.record.capture_id} is not complete: {'; '.join(told[:3])}{more}",
            "see to the cause, then take a new capture under another id",
        )


@dataclass(frozen=True)
class DryRun:
    """All but FIRE went well. ``faults``: cameras a partial capture would be without."""

    ready: tuple[str, ...]
    faults: tuple[Fault, ...]
    seconds: float


@dataclass(frozen=True)
class DeviceCheck:
    """One thing looked at: whether it is well, and a sentence."""

    name: str
    ok: bool
    text: str


@dataclass(frozen=True)
class SelfTest:
    """What a self-test found; nothing was fired."""

    checks: tuple[DeviceCheck, ...]

    @property
    def ok(self) -> bool:
        """Whether everything is well."""
        return all(check.ok for check in self.checks)


@dataclass(frozen=True)
class SyncCheck:
    """Several captures that were looked at and not filed.

    ``timings``: the delays that would bring the exposures together, None with ``why_not`` where
    they cannot be told.
    """

    captures: tuple[Evidence, ...]
    faults: tuple[Fault, ...]
    lags: Mapping[str, LagEstimate]
    timings: Mapping[str, Timing] | None
    why_not: str = ""


def judged_lags(
    station: Station, captures: Sequence[Evidence], faults: Sequence[Fault]
) -> SyncCheck:
    """The lags that several captures show, and the delays they ask for where all are known."""
    lags = estimate_lags(captures)
    try:
        timings = new_timings(station, lags)
    except InputError as error:
        return SyncCheck(tuple(captures), tuple(faults), lags, None, error.problem)
    return SyncCheck(tuple(captures), tuple(faults), lags, timings)


@dataclass(frozen=True)
class RigHealth:
    """How the devices are, and what the rig is doing."""

    box: TriggerHealth | None
    cameras: Mapping[str, CameraHealth] = field(default_factory=dict)
    busy: str | None = None
    previews: frozenset[str] = frozenset()
    """Names of the cameras that can show what they see between captures."""
