"""What one camera gave in one capture, before and after its pictures are given to shots."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from rig.acquisition.cameras.base import CameraCapabilities, Frame
from rig.acquisition.synchrony.clocks import DeviceClock, TriggerTime
from rig.acquisition.synchrony.faults import Fault


class Method(StrEnum):
    """How a picture was given to its shot, best first."""

    TIMESTAMP = "timestamp"
    """The camera's time stamp lies where the shot's trigger puts it."""
    FILE_TIME = "file-time"
    """The time in the file fits the shot by the offset of the camera's clock."""
    ARRIVAL = "arrival-order"
    """A last resort: as many pictures came as were asked for, in this order."""


@dataclass(frozen=True, eq=False)
class CameraFrames:
    """One camera's part of a capture.

    ``trigger_times``: when it was told to expose, in shot order, at least one. ``armed_host_ns``:
    when it was ready. ``clock`` is None where its time stamps cannot be related to the host's
    clock; ``clock_jumped`` where they could until its clock jumped. Lags are from trigger to
    exposure; ``deadline_s`` from trigger to arrival, and of a camera that keeps its pictures from
    when it was first asked afterwards (``asked_host_ns``).
    """

    camera: str
    capabilities: CameraCapabilities
    frames: tuple[Frame, ...]
    trigger_times: tuple[TriggerTime, ...]
    armed_host_ns: int
    clock: DeviceClock | None = None
    clock_jumped: bool = False
    lag_us: float = 0.0
    lag_tolerance_us: float = 20_000.0
    deadline_s: float = float("inf")
    asked_host_ns: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Pair:
    """A picture and its shot. ``exposed_host_ns`` is the start of its exposure, where known."""

    shot: int
    frame: Frame
    method: Method
    exposed_host_ns: int | None = None
    uncertainty_us: float = float("inf")


@dataclass(frozen=True, eq=False)
class Pairing:
    """All that was found out about one camera's pictures; ``pairs`` in shot order."""

    camera: str
    pairs: tuple[Pair, ...]
    faults: tuple[Fault, ...]

    def pair(self, shot: int) -> Pair | None:
        """The picture of one shot, None when there is none."""
        return next((pair for pair in self.pairs if pair.shot == shot), None)
