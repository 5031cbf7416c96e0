"""From a camera's clock to the host's, as far as pairing and evidence need it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Protocol

from rig.acquisition.cameras.base import ClockSample

NS_PER_US = 1000.0
LARGEST_RATE_ERROR = 5e-3
"""A crystal is right to 1e-4, a resonator to 5e-3; clocks farther apart did not run through."""


class DeviceClock(Protocol):
    """A fitted relation of one camera's clock to the host's monotonic clock."""

    def host_ns(self, device_ns: int) -> int:
        """The instant on the host's monotonic clock."""
        ...

    def uncertainty_us(self, device_ns: int) -> float:
        """Half width within which :meth:`host_ns` of the same instant is known."""
        ...


ClockFitter = Callable[[Sequence[ClockSample]], DeviceClock | None]
"""Makes a clock of readings, or None of too few of them."""


def fit_clock(samples: Sequence[ClockSample]) -> DeviceClock | None:
    """The clock through all readings of a capture, by the same model as the trigger box's.

    However long the capture took: a camera is read before it is armed and again with its
    pictures. Without the first of these its line would be drawn backwards from readings that
    lie within milliseconds.
    """
    from rig.acquisition.trigger.clock import line_through

    return line_through(sorted(samples, key=lambda sample: sample.host_before_ns))


class TriggerTimeSource(StrEnum):
    """How it is known when a camera was told to expose."""

    EDGE_LOG = "edge-log"
    """The box logged the edge."""
    PROGRAMMED = "programmed"
    """The box was told to make it then; it keeps no log."""
    COMMAND = "command"
    """The host sent a command over the camera's bus."""
    NONE = "none"
    """Somebody else fires this camera."""


@dataclass(frozen=True)
class TriggerTime:
    """When one camera was told to expose, on the host's clock, and how well that is known."""

    shot: int
    at_host_ns: int
    uncertainty_us: float
    source: TriggerTimeSource


def clock_jumped(samples: Sequence[ClockSample]) -> bool:
    """Whether a camera's clock was set back, or began anew, between its readings."""
    ordered = sorted(samples, key=lambda sample: sample.host_before_ns)
    for a, b in pairwise(ordered):
        device = b.device_ns - a.device_ns
        # The true time between the two readings lies between these.
        least = b.host_before_ns - a.host_after_ns
        most = b.host_after_ns - a.host_before_ns
        slack = LARGEST_RATE_ERROR * most + NS_PER_US
        if not least - slack <= device <= most + slack:
            return True
    return False
