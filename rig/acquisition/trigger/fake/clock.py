"""The clock of a fake box: ticks of 0.5 us that run a little fast or slow."""

from __future__ import annotations

from dataclasses import dataclass

from rig.acquisition.trigger.protocol import TICK_NS

INSTANT_MODULUS = 1 << 48


@dataclass(frozen=True)
class BoxClock:
    """Ticks since a start. ``drift_ppm`` > 0 runs fast against the host."""

    started_host_ns: int
    drift_ppm: float
    start_ticks: int

    def ticks(self, host_ns: int) -> int:
        """The box's clock at an instant of the host's."""
        elapsed = (host_ns - self.started_host_ns) * (1.0 + self.drift_ppm * 1e-6)
        return self.start_ticks + int(elapsed / TICK_NS)

    def host_ns(self, ticks: int) -> int:
        """The first nanosecond at which :meth:`ticks` has reached ``ticks``."""
        elapsed = (ticks - self.start_ticks) * TICK_NS / (1.0 + self.drift_ppm * 1e-6)
        return self.started_host_ns + int(elapsed) + 1
