"""What the fake box can do, and what it did at its outputs."""

from __future__ import annotations

from dataclasses import dataclass

from rig.acquisition.trigger.edges import STROBES


@dataclass(frozen=True)
class FakeLimits:
    """What ``CAP?`` and ``SAFE?`` report, in ticks but where a name ends in ``_ms``."""

    max_delay_ticks: int = 60_000_000
    max_width_ticks: int = 10_000_000
    max_strobe_width_ticks: int = 200_000
    gap_ticks: int = 40
    max_edges: int = 32
    max_shots: int = 255
    hold_ms: int = 600_000
    dead_man_ms: int = 3000
    least_dead_man_ms: int = 500
    longest_dead_man_ms: int = 30_000
    strobe_rest: int = 8000
    strobe_duty: int = 4
    """A strobe may be on for one part in so many."""

    def rest_after(self, width_ticks: int) -> int:
        """How long a strobe is off after a pulse of that width, at least."""
        return max(self.strobe_rest, width_ticks * (self.strobe_duty - 1))

    def width_of(self, output: int) -> int:
        """The widest pulse of one output."""
        return self.max_strobe_width_ticks if output in STROBES else self.max_width_ticks


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
