"""When each camera was told to expose, from the best that is known about it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from rig.acquisition.station.spec import CameraPlan, Station
from rig.acquisition.synchrony.clocks import NS_PER_US, TriggerTime, TriggerTimeSource
from rig.acquisition.trigger.box import FireReport

PROGRAMMED_SLACK_US = 20_000.0
"""A box without a log acts when the line has reached it: a USB adapter's latency of 16 ms, and the
time on the wire."""


@dataclass(frozen=True)
class HostInterval:
    """Something happened between these two instants of the host's clock."""

    before_ns: int
    after_ns: int

    @property
    def middle_ns(self) -> int:
        """The best guess."""
        return (self.before_ns + self.after_ns) // 2

    @property
    def half_width_us(self) -> float:
        """How far off the guess can be."""
        return (self.after_ns - self.before_ns) / 2.0 / NS_PER_US


def edge_times(
    station: Station,
    plan: CameraPlan,
    report: FireReport | None,
    fired: HostInterval,
    shots: int,
    interval_us: float,
) -> tuple[TriggerTime, ...]:
    """When the box told ``plan`` to expose: from its log, else from what it was told to do.

    ``shots`` is how many there were, as far as is known.
    """
    edges = () if report is None or plan.output is None else report.rising_edges(plan.output)
    if edges and report is not None and math.isfinite(report.clock_uncertainty_us):
        return tuple(
            TriggerTime(
                edge.shot, edge.at_host_ns, report.clock_uncertainty_us, TriggerTimeSource.EDGE_LOG
            )
            for edge in sorted(edges, key=lambda edge: edge.shot)
        )
    lead = station.trigger.lead_us if station.trigger is not None else 0.0
    first = fired.middle_ns + (lead + station.shutter_delay_us(plan)) * NS_PER_US
    source = TriggerTimeSource.PROGRAMMED if plan.output is not None else TriggerTimeSource.NONE
    slack = fired.half_width_us + PROGRAMMED_SLACK_US
    return tuple(
        TriggerTime(k + 1, round(first + k * interval_us * NS_PER_US), slack, source)
        for k in range(shots)
    )


def command_times(sent: Mapping[int, HostInterval]) -> tuple[TriggerTime, ...]:
    """When a camera was told over its bus, by shot."""
    return tuple(
        TriggerTime(shot, told.middle_ns, told.half_width_us, TriggerTimeSource.COMMAND)
        for shot, told in sorted(sent.items())
    )
