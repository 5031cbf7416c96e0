"""What came of one firing, in memory: everything that pairing, evidence and filing need."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from rig.acquisition.cameras.base import CameraInfo, CameraSettings, ClockSample, Frame
from rig.acquisition.station.spec import CameraPlan
from rig.acquisition.synchrony.cameraframes import CameraFrames, Pairing
from rig.acquisition.synchrony.faults import Fault
from rig.acquisition.trigger.box import ArmRequest, FireReport


@dataclass(frozen=True, eq=False)
class CameraPart:
    """One camera's part: who it is, what it was set to, what it gave and what that means."""

    plan: CameraPlan
    info: CameraInfo
    settings: CameraSettings
    """What it really had, as far as it can tell."""
    received: CameraFrames
    pairing: Pairing
    raws: Pairing | None = None
    """Raw files that came beside the pictures, paired by themselves."""
    clock_samples: tuple[ClockSample, ...] = ()
    unfiled: tuple[Frame, ...] = ()
    """Files that came and were given to no shot."""

    def without(self, shots: Collection[int | None]) -> CameraPart:
        """The same without the pictures of some shots."""
        left = tuple(one for one in self.pairing.pairs if one.shot not in shots)
        return replace(self, pairing=replace(self.pairing, pairs=left))


@dataclass(frozen=True, eq=False)
class CaptureData:
    """One firing. ``fired_at`` is wall-clock time of the first shot, with its offset.

    ``report`` is None for a station without a box. ``shots_done`` is how many shots there were.
    ``absent``: cameras of the station that took no part. ``faults`` are those of no camera's
    pictures: cameras not ready, shots not fired.
    """

    capture_id: str
    shots: int
    interval_us: float
    fired_at: datetime
    fired_host_ns: int
    request: ArmRequest | None
    report: FireReport | None
    shots_done: int
    parts: tuple[CameraPart, ...]
    absent: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()

    @property
    def all_faults(self) -> tuple[Fault, ...]:
        """The faults of the whole, those of the pictures included."""
        found: list[Fault] = list(self.faults)
        for part in self.parts:
            found += part.pairing.faults
        return tuple(found)

    @property
    def whole(self) -> bool:
        """Whether every camera of the station gave a sound picture of every shot asked for."""
        return not self.missing() and all(fault.harmless for fault in self.all_faults)

    def without(self, lost: Sequence[Fault]) -> CaptureData:
        """The same without the pictures that these faults are about, which it then carries."""
        gone = {(fault.camera, fault.shot) for fault in lost}
        parts = tuple(
            part.without({s for name, s in gone if name == part.plan.name}) for part in self.parts
        )
        return replace(self, parts=parts, faults=(*self.faults, *lost))

    def missing(self) -> Mapping[str, Sequence[int]]:
        """Shots (from 1) without a picture, by camera; cameras that have all are left out."""
        wanted = range(1, self.shots + 1)
        lost = {
            part.plan.name: [s for s in wanted if part.pairing.pair(s) is None]
            for part in self.parts
        }
        lost.update({name: list(wanted) for name in self.absent})
        return {name: shots for name, shots in lost.items() if shots}
