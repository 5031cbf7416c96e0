"""Cables that look swapped: two cameras that each answer the other's output.

Only outputs with different delays can be told apart by time. Cameras whose outputs rise at the
same instant do no harm when swapped; cameras whose *names* are swapped answer at the right time
and are found by calibration, never by timing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from statistics import median

from rig.acquisition.station.spec import Station
from rig.acquisition.synchrony.capturedata import CameraPart
from rig.acquisition.synchrony.clocks import NS_PER_US
from rig.acquisition.synchrony.faults import Fault, FaultKind

CLEAR_US = 500.0
"""Outputs whose delays differ by less cannot be told apart by cameras of ordinary jitter."""


def swapped(station: Station, parts: Sequence[CameraPart]) -> list[Fault]:
    """One fault for each two cameras whose lags are off by just the difference of their delays."""
    faults = []
    for a, b in combinations(parts, 2):
        apart = station.shutter_delay_us(b.plan) - station.shutter_delay_us(a.plan)
        if a.plan.output is None or b.plan.output is None or abs(apart) < CLEAR_US:
            continue
        off_a, off_b = _lag_off_us(a), _lag_off_us(b)
        near = abs(apart) / 4.0
        if abs(off_a - apart) < near and abs(off_b + apart) < near:
            text = (
                f"{a.plan.name} and {b.plan.name} each expose at the other's instant: the cables "
                f"of outputs {a.plan.output} and {b.plan.output} look swapped"
            )
            faults.append(Fault(FaultKind.SWAPPED, text))
    return faults


def _lag_off_us(part: CameraPart) -> float:
    """By how much a camera exposes later than expected, in the middle of its shots; NaN unknown.

    All stamped pictures count, those that pairing left out as too early or late as well.
    """
    received = part.received
    if received.clock is None or not received.trigger_times:
        return math.nan
    times = sorted(
        received.clock.host_ns(frame.device_ns)
        for frame in received.frames
        if frame.device_ns is not None
    )
    if len(times) != len(received.trigger_times):
        return math.nan
    lags = [
        (at - trigger_time.at_host_ns) / NS_PER_US
        for at, trigger_time in zip(times, received.trigger_times, strict=True)
    ]
    return median(lags) - received.lag_us
