"""What the fake box can do, and what it did at its outputs."""

from __future__ import annotations

from dataclasses import dataclass

from rig.acquisition.trigger.edges import STROBES


@dataclass(frozen=True)
class FakeLimits:
    """What ``CAP?`` reports, in ticks but ``hold_ms``."""

    max_delay: int = 60_000_000
    max_width: int = 10_000_000
    max_strobe_width: int = 200_000
    gap: int = 40
    max_edges: int = 32
    max_shots: int = 255
    hold_ms: int = 600_000

    def width_of(self, output: int) -> int:
        """The widest pulse of one output."""
        return self.max_strobe_width if output in STROBES else self.max_width


@dataclass(frozen=True)
class PhysicalEdge:
    """One change of one output that was really made: what a logic analyser would see.

    ``host_ns`` is on the clock that the fake was given, whatever the box's own clock says.
    """

    host_ns: int
    ticks: int
    output: int
    rising: bool
    capture: str
